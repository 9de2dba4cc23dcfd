//! The tracker's thread.

use std::collections::VecDeque;
use std::time::Instant;

use mba_io::dataset::Dataset;
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::error::FrameError as TrackError;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::{SimdLevel, Tracker, TrackerConfig};

use super::arrival_clock::Pace;
use super::messages::{Instruction, SharpView, Skipped, TrackedFrame, TrackerLink};
use super::saved::Replay;
use super::settings::Arrival;
use crate::tracking::{TrackingError, add_gyroscope, held, record, timed, timed_result, tracker_view};
use crate::uncertainty::Uncertainty;

/// Frames that the tracker is ahead of its instructions in lock step: while the mapper works on one frame, the next is
/// tracked.
const AHEAD: usize = 2;

/// What the tracker's thread is made of.
struct FrontEnd<'a, 'm> {
    dataset: &'a Dataset,
    tracker: Tracker<'m>,
    link: &'a TrackerLink,
    /// Index in the data set of every frame that the tracker was given.
    given: Given,
    moves: usize,
    /// The last exposure, for frames without one.
    last: Option<TimedExposure>,
    uncertainty: Uncertainty,
}

/// The tracker counts the frames it was given, the run those of the data set; only the last few are asked for.
#[derive(Default)]
struct Given {
    count: usize,
    recent: VecDeque<usize>,
}

impl Given {
    fn push(&mut self, index: usize) {
        self.recent.push_back(index);
        self.count += 1;
        if self.recent.len() > 8 {
            self.recent.pop_front();
        }
    }

    fn index(&self, number: usize) -> Option<usize> {
        let first = self.count - self.recent.len();
        self.recent.get(number.checked_sub(first)?).copied()
    }
}

/// Tracks the data set frame by frame until its end, or until nobody listens any more. Frames that were mapped before are
/// tracked as they were then. Returns how far picture and depth contradict each other in the median frame.
pub(super) fn run(
    dataset: &Dataset,
    config: &TrackerConfig,
    arrival: Arrival,
    link: TrackerLink,
    mut replay: Replay,
) -> Result<f64, TrackingError> {
    let mut memory = vec![0; config.workspace_len()];
    let tracker = Tracker::new(config, SimdLevel::new(), &mut memory).map_err(TrackingError::Camera)?;
    let given = Given::default();
    let mut front_end = FrontEnd {
        dataset,
        tracker,
        link: &link,
        given,
        moves: 0,
        last: None,
        uncertainty: Uncertainty::default(),
    };
    let pace = Pace::new(arrival, dataset.timestamp(0), 1.0 / dataset.calibration().frame_rate);
    for index in 0..dataset.len() {
        let arrived = pace.wait_for(dataset.timestamp(index));
        // What a run that was stopped was told is told again; the mapper only gets frames that are new to it.
        let told_before = index.checked_sub(AHEAD).filter(|told| replay.has(*told));
        let instructions = match told_before {
            Some(told) => Some(vec![replay.take(told)]),
            None => front_end.instructions(arrival, index),
        };
        let Some(instructions) = instructions else { break };
        let tracked =
            if arrived { front_end.track(index, instructions) } else { front_end.skip(index, Skipped::Late) };
        if !replay.has(index) && link.frames.send(tracked).is_err() {
            break;
        }
    }
    Ok(front_end.uncertainty.disagreement())
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
        let previous = self.given.recent.back().copied();
        let tracked = tracker_view(&image).and_then(|mut frame| {
            add_gyroscope(&mut frame, self.dataset, previous);
            self.tracker.track(&frame)
        });
        let result = match tracked {
            Ok(result) => result,
            Err(reason) => return self.skip(index, Skipped::Unusable(reason.to_string())),
        };
        let ms = (begin.elapsed() + following).as_secs_f64() * 1e3;
        self.given.push(index);
        self.uncertainty.add(&result);
        // Indices of the tracker become those of the data set.
        let revision = result.revision.as_ref().and_then(|revision| {
            let revised = self.given.index(revision.index)?;
            let timestamp = self.dataset.timestamp(revised);
            let exposure = timed(timestamp, &revision.world_from_camera, &revision.world_from_mid);
            Some((revised, exposure, f64::from(revision.blur)))
        });
        let exposure = timed_result(&result);
        self.last = Some(exposure);
        let record = record(&result, ms);
        TrackedFrame {
            index,
            exposure,
            record,
            moves: self.moves,
            image: Some(image),
            skipped: None,
            revision,
        }
    }

    fn skip(&mut self, index: usize, reason: Skipped) -> TrackedFrame {
        let (exposure, record) = held(self.dataset.timestamp(index), self.last.as_ref());
        let (moves, skipped) = (self.moves, Some(reason));
        TrackedFrame { index, exposure, record, moves, image: None, skipped, revision: None }
    }

    fn follow(&mut self, instruction: Instruction) -> Result<(), TrackError> {
        if let Some(new_world_from_world) = instruction.world_move {
            self.moves += 1;
            self.move_world(&new_world_from_world)?;
        }
        match instruction.reference {
            Some(view) => self.take_reference(&view),
            None => Ok(()),
        }
    }

    fn move_world(&mut self, new_world_from_world: &RigidTransform) -> Result<(), TrackError> {
        if let Some(last) = &mut self.last {
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
