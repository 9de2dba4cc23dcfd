//! The tracker's thread.

use std::time::Instant;

use mba_io::checkpoint::CheckpointError;
use mba_io::dataset::Dataset;
use mba_tracker::error::FrameError as TrackError;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::{Tracker, TrackerConfig};

use super::arrival_clock::Pace;
use super::messages::{AHEAD, Instruction, SharpView, Skipped, TrackedFrame, TrackerLink};
use super::saved::Replay;
use super::settings::Arrival;
use super::tracker_state::{ThreadState, TrackerState};
use crate::tracking::{TrackingError, add_gyroscope, held, record, timed, timed_result, tracker_view};

/// What the tracker's thread is made of.
struct FrontEnd<'a, 'm> {
    dataset: &'a Dataset,
    tracker: Tracker<'m>,
    link: &'a TrackerLink,
    state: ThreadState,
    /// Memory for states that are handed over.
    spent: Vec<Vec<u8>>,
}

/// Tracks the data set frame by frame until its end, or until nobody listens any more, from the first frame that was not
/// mapped before.
pub(super) fn run(
    dataset: &Dataset,
    config: &TrackerConfig,
    arrival: Arrival,
    link: TrackerLink,
    mut replay: Option<Replay>,
) -> Result<(), TrackingError> {
    let mut memory = vec![0; config.workspace_len()];
    let mut tracker = Tracker::new(config, dataset.simd(), &mut memory).map_err(TrackingError::Camera)?;
    let (mut state, mut first) = (ThreadState::default(), 0);
    if let Some(replay) = &mut replay {
        first = replay.frames;
        let unsound = |reason| CheckpointError::Session { path: replay.path.clone(), reason };
        state = std::mem::take(&mut replay.knows).restore(&mut tracker).map_err(unsound)?;
    }
    let mut front_end = FrontEnd { dataset, tracker, link: &link, state, spent: Vec::new() };
    let pace = Pace::new(arrival, dataset.timestamp(0), 1.0 / dataset.calibration().frame_rate);
    for index in first..dataset.len() {
        let arrived = pace.wait_for(dataset.timestamp(index));
        // What a run that was stopped was told after its last frames is told again.
        let told_before = index.checked_sub(AHEAD).filter(|told| *told < first);
        let instructions = match (told_before, &mut replay) {
            (Some(told), Some(replay)) => Some(vec![replay.take(told)]),
            _ => front_end.instructions(arrival, index),
        };
        let Some(instructions) = instructions else { break };
        let mut tracked =
            if arrived { front_end.track(index, instructions) } else { front_end.skip(index, Skipped::Late) };
        tracked.knows = (arrival == Arrival::LockStep).then(|| front_end.known());
        if link.frames.send(tracked).is_err() {
            break;
        }
    }
    Ok(())
}

impl FrontEnd<'_, '_> {
    /// The instructions to follow before frame `index`; `None` when the mapper is gone.
    fn instructions(&self, arrival: Arrival, index: usize) -> Option<Vec<Instruction>> {
        match arrival {
            Arrival::LockStep if index < AHEAD => Some(Vec::new()),
            Arrival::LockStep => self.link.instructions.recv().ok().map(|instruction| vec![instruction]),
            Arrival::RealTime => Some(self.link.instructions.try_iter().collect()),
        }
    }

    fn track(&mut self, index: usize, instructions: Vec<Instruction>) -> TrackedFrame {
        let begin = Instant::now();
        // Moves of the world and views first, so that the frame is tracked in the world as it is now.
        let followed = instructions.into_iter().try_for_each(|instruction| self.follow(instruction));
        let following = begin.elapsed();
        let image = match (followed, self.dataset.frame(index)) {
            (Err(reason), _) => return self.skip(index, Skipped::Unusable(reason.to_string())),
            (_, Err(reason)) => return self.skip(index, Skipped::Unusable(reason.to_string())),
            (Ok(()), Ok(image)) => image,
        };
        let begin = Instant::now();
        let previous = self.state.recent.newest();
        let tracked = tracker_view(&image).and_then(|mut frame| {
            add_gyroscope(&mut frame, self.dataset, previous);
            self.tracker.track(&frame)
        });
        let result = match tracked {
            Ok(result) => result,
            Err(reason) => return self.skip(index, Skipped::Unusable(reason.to_string())),
        };
        let ms = (begin.elapsed() + following).as_secs_f64() * 1e3;
        self.state.recent.push(index);
        // Indices of the tracker become those of the data set.
        let revision = result.revision.as_ref().and_then(|revision| {
            let revised = self.state.recent.index(revision.index)?;
            let timestamp = self.dataset.timestamp(revised);
            let exposure = timed(timestamp, &revision.world_from_camera, &revision.world_from_mid);
            Some((revised, exposure, f64::from(revision.blur)))
        });
        let exposure = timed_result(&result);
        self.state.last = Some(exposure);
        let record = record(&result, ms);
        TrackedFrame {
            index,
            exposure,
            record,
            moves: self.state.moves,
            image: Some(image),
            skipped: None,
            revision,
            disagreement: Some(result.disagreement),
            knows: None,
        }
    }

    fn skip(&mut self, index: usize, reason: Skipped) -> TrackedFrame {
        let (exposure, record) = held(self.dataset.timestamp(index), self.state.last.as_ref());
        let (moves, skipped) = (self.state.moves, Some(reason));
        TrackedFrame {
            index,
            exposure,
            record,
            moves,
            image: None,
            skipped,
            revision: None,
            disagreement: None,
            knows: None,
        }
    }

    /// What is known now.
    fn known(&mut self) -> TrackerState {
        TrackerState::of(&mut self.tracker, &self.state, self.spent.pop().unwrap_or_default())
    }

    fn follow(&mut self, instruction: Instruction) -> Result<(), TrackError> {
        self.spent.extend(Some(instruction.spent).filter(|spent| spent.capacity() > 0));
        if let Some(new_world_from_world) = instruction.world_move {
            self.state.moves += 1;
            self.move_world(&new_world_from_world)?;
        }
        match instruction.reference {
            Some(view) => self.take_reference(&view),
            None => Ok(()),
        }
    }

    fn move_world(&mut self, new_world_from_world: &RigidTransform) -> Result<(), TrackError> {
        if let Some(last) = &mut self.state.last {
            *last = last.seen_from(new_world_from_world);
        }
        self.tracker.move_world(new_world_from_world)
    }

    fn take_reference(&mut self, view: &SharpView) -> Result<(), TrackError> {
        let reference = view.reference(&self.dataset.calibration().camera)?;
        match &view.start_from {
            Some(world_from_camera) => self.tracker.relocate(&reference, world_from_camera),
            None => self.tracker.set_reference(&reference),
        }
    }
}
