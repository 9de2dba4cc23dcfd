//! The mapper's side of the loop.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use mba_adjust::bundle::{BundleState, MapKeyframe, MapModel, PathPrior};
use mba_io::checkpoint::exact_poses::{numbers, pose};
use mba_io::dataset::{Dataset, RgbdFrame};
use mba_io::statistics::quantile;
use mba_io::trajectory_file::TimedExposure;
use mba_raster::sensor::{ObservationPyramid, Sensor};
use mba_tracker::TrackerConfig;
use mba_tracker::geometry::RigidTransform;

use super::SlamError;
use super::growing_map::{GrowingMap, LEVELS};
use super::loops::Loops;
use super::messages::{Instruction, MapperLink, SharpView, Skipped, TrackedFrame};
use super::progress::SlamProgress;
use super::saved::{Counts, Keeper, MapperParts, Replay, SavedKeyframe};
use super::settings::{Arrival, SlamReference, SlamSettings};
use super::tracker_state::TrackerState;
use crate::mapping::sensor;
use crate::run::{FrameRecord, FrameStatus, RunError, RunWriter, SlamFigures};

/// Time after which the folder is brought up to date: a run that is killed loses no more.
const FLUSH_EVERY: Duration = Duration::from_secs(2);

/// Frames between two comparisons of map and keyframe as references.
const JUDGE_EVERY: usize = 8;

/// The map is the better reference if its residual is below that of the keyframe by this factor: what a map gets wrong
/// in depth, the residual of the picture does not show.
const MAP_IS_BETTER: f32 = 0.8;

/// Takes tracked frames, grows the map, and tells the tracker what to do.
pub(super) struct BackEnd {
    map: GrowingMap,
    loops: Loops,
    settings: SlamSettings,
    writer: RunWriter,
    /// Every move of the world so far, `new_world_from_world`.
    moves: Vec<RigidTransform>,
    figures: SlamFigures,
    /// Whether frames are aligned with the map.
    on_map: bool,
    /// Frames since that was decided.
    undisputed: usize,
    /// How far picture and depth contradict each other, of each frame that was tracked.
    disagreements: Vec<f64>,
    /// What the tracker knew after the newest frame, in lock step.
    tracker: TrackerState,
    /// For checkpoints, in lock step.
    keeper: Option<Keeper>,
}

impl BackEnd {
    pub(super) fn new(
        dataset: &Dataset,
        config: &TrackerConfig,
        settings: &SlamSettings,
        (writer, keeper): (RunWriter, Option<Keeper>),
    ) -> Self {
        Self {
            map: GrowingMap::new(dataset.simd(), sensor(dataset), settings),
            loops: Loops::new(config, dataset.simd()),
            settings: *settings,
            writer,
            moves: Vec::new(),
            figures: SlamFigures::default(),
            on_map: false,
            undisputed: 0,
            disagreements: Vec::new(),
            tracker: TrackerState::default(),
            keeper,
        }
    }

    /// Takes over what a run that was stopped knew; returns what its tracker goes on from.
    pub(super) fn restore(
        &mut self,
        dataset: &Dataset,
        parts: MapperParts,
        state: BundleState,
    ) -> Result<Option<Replay>, SlamError> {
        let images = keyframe_images(dataset, &parts.keyframes)?;
        let keyframes = keyframes(&self.map.sensor, &parts.keyframes, &images)?;
        let (simd, sensor) = (dataset.simd(), self.map.sensor.clone());
        let grown = (parts.max_gaussians, parts.growth);
        self.map = GrowingMap::restored((simd, sensor), &self.settings, (keyframes, state), grown);
        self.loops.restore(&parts.loops, &images, &self.map.sensor.camera);
        self.moves = parts.moves.into_iter().map(pose).collect();
        let Counts { frames_on_map, late_frames, relocalisations } = parts.counts;
        self.figures = SlamFigures { frames_on_map, late_frames, relocalisations, ..self.figures };
        (self.on_map, self.undisputed) = (parts.on_map, parts.undisputed);
        self.disagreements = parts.disagreements;
        let replay = self.keeper.as_mut().map(|keeper| {
            keeper.go_on(parts.seconds, parts.instructions.clone());
            Replay::new((parts.rows.len(), parts.tracker), parts.instructions, keeper.path().to_owned())
        });
        self.writer.restore(parts.rows)?;
        Ok(replay)
    }

    /// Writes a checkpoint; nothing happens where there are none.
    fn save(&mut self) -> Result<(), SlamError> {
        let Some(mut keeper) = self.keeper.take() else { return Ok(()) };
        let parts = |instructions, seconds| MapperParts {
            rows: self.writer.record().rows(),
            keyframes: self.map.saved_keyframes(),
            max_gaussians: self.map.bundle.max_gaussians(),
            growth: self.map.growth(),
            loops: self.loops.saved(),
            moves: self.moves.iter().map(numbers).collect(),
            counts: self.counts(),
            on_map: self.on_map,
            undisputed: self.undisputed,
            disagreements: self.disagreements.clone(),
            tracker: self.tracker.clone(),
            instructions,
            seconds,
        };
        let saved = keeper.save_growing(parts, self.map.bundle.state());
        self.keeper = Some(keeper);
        Ok(saved?)
    }

    /// What was counted so far.
    fn counts(&self) -> Counts {
        let SlamFigures { frames_on_map, late_frames, relocalisations, .. } = self.figures;
        Counts { frames_on_map, late_frames, relocalisations }
    }

    /// Works until the tracker has no more frames, or `observe` asks for an end.
    pub(super) fn run(
        &mut self,
        link: MapperLink,
        observe: &mut impl FnMut(SlamProgress) -> ControlFlow<()>,
    ) -> Result<(), SlamError> {
        let MapperLink { frames, instructions } = link;
        let is_live = self.settings.arrival == Arrival::RealTime;
        let (mut next, mut flushed) = (None, Instant::now());
        while let Some(mut frame) = next.take().or_else(|| frames.recv().ok()) {
            if is_live {
                next = frames.try_recv().ok();
            }
            let index = frame.index;
            let spent = std::mem::replace(&mut self.tracker, frame.knows.take().unwrap_or_default());
            let instruction = if next.is_some() {
                // Behind the camera: only the newest frame is mapped.
                self.record(&frame)?;
                Instruction::default()
            } else {
                self.take(frame, |effort_left| {
                    if is_live {
                        next = next.take().or_else(|| frames.try_recv().ok());
                    }
                    effort_left > 0.0 && next.is_none()
                })?
            };
            if let Some(keeper) = &mut self.keeper {
                keeper.note(index, &instruction);
            }
            // A tracker that is gone needs no instructions.
            let _ = instructions.send(Instruction { spent: spent.into_memory(), ..instruction });
            if flushed.elapsed() >= FLUSH_EVERY {
                self.writer.flush()?;
                flushed = Instant::now();
            }
            let flow = observe(SlamProgress::Frames {
                frames: self.writer.record().exposures().len(),
                keyframes: self.map.bundle.frames.len(),
                map: self.map.bundle.map.size(),
                loops: self.loops.closed(),
            });
            if flow.is_break() || self.keeper.as_ref().is_some_and(Keeper::is_due) {
                self.save()?;
            }
            if flow.is_break() {
                self.writer.flush()?;
                return Err(SlamError::Stopped);
            }
        }
        Ok(())
    }

    /// How far picture and depth contradict each other in the median frame.
    pub(super) fn disagreement(&self) -> f64 {
        quantile(&self.disagreements, 0.5).unwrap_or(0.0)
    }

    /// The map, the run, what was counted, and what keeps it.
    pub(super) fn finish(self) -> (GrowingMap, RunWriter, SlamFigures, Option<Keeper>) {
        let (loops, retired_keyframes) = (self.loops.closed(), self.map.retired);
        let figures = SlamFigures { loops, retired_keyframes, ..self.figures };
        (self.map, self.writer, figures, self.keeper)
    }

    /// Adds a frame to the run; returns its exposure.
    fn record(&mut self, frame: &TrackedFrame) -> Result<TimedExposure, RunError> {
        let exposure = self.in_this_world(&frame.exposure, frame.moves);
        self.disagreements.extend(frame.disagreement);
        // The frame before is moved as the world has been since.
        if let Some((index, revised, blur_px)) = &frame.revision {
            let revised = self.in_this_world(revised, frame.moves);
            self.writer.record_mut().revise(*index, revised, *blur_px);
            self.map.revise(*index, &revised);
        }
        match &frame.skipped {
            None => self.writer.push(exposure, frame.record)?,
            Some(Skipped::Late) => {
                self.figures.late_frames += 1;
                self.writer.push_skipped(exposure, frame.record)?;
            }
            Some(Skipped::Unusable(reason)) => {
                self.writer.record_mut().warn(format!("frame {} skipped: {reason}", frame.index));
                self.writer.push_skipped(exposure, frame.record)?;
            }
        }
        Ok(exposure)
    }

    /// Adds a frame to the run and to the map, works as long as `goes_on` with the effort that is left, and says what
    /// the tracker should do.
    fn take(
        &mut self,
        frame: TrackedFrame,
        goes_on: impl FnMut(f64) -> bool,
    ) -> Result<Instruction, RunError> {
        let exposure = self.record(&frame)?;
        let Some(image) = frame.image else { return Ok(Instruction::default()) };
        match frame.record.status {
            FrameStatus::Lost => {
                let reference = self.loops.find(&self.map, &image);
                self.figures.relocalisations += usize::from(reference.is_some());
                Ok(Instruction { reference, ..Instruction::default() })
            }
            FrameStatus::Ok => Ok(self.map_frame(exposure, frame.record.blur_px, &image, goes_on)),
            FrameStatus::Weak => {
                self.map.work(&exposure.mid, goes_on);
                Ok(Instruction::default())
            }
        }
    }

    /// Takes in a frame whose pose can be trusted.
    fn map_frame(
        &mut self,
        exposure: TimedExposure,
        blur_px: f64,
        image: &RgbdFrame,
        goes_on: impl FnMut(f64) -> bool,
    ) -> Instruction {
        let mut world_move = None;
        let mut pose = exposure.mid;
        if self.map.insert_frame(&exposure, blur_px, image) {
            self.loops.remember(&self.map, image);
            if self.settings.loops {
                world_move = self.close_loop(image);
            }
        }
        if let Some(new_world_from_world) = &world_move {
            pose = new_world_from_world.compose(&pose);
        }
        self.map.work(&pose, goes_on);
        Instruction { world_move, reference: self.reference(&pose, image), ..Instruction::default() }
    }

    /// Moves map and run if the newest keyframe shows that they have drifted; returns what happened around it.
    fn close_loop(&mut self, image: &RgbdFrame) -> Option<RigidTransform> {
        // Map, run and tracker move together; frames that are on their way are moved when they arrive.
        let poses = self.loops.correct(&self.map, image)?;
        let moves = self.map.bundle.move_keyframes(&poses);
        self.writer.record_mut().move_world(|index| moves.of(index));
        self.moves.push(moves.last());
        Some(moves.last())
    }

    /// A view for the frames after that from `pose`, if the tracker should change to one.
    fn reference(&mut self, pose: &RigidTransform, image: &RgbdFrame) -> Option<SharpView> {
        if self.settings.reference != SlamReference::Map || !self.map.is_mature() {
            return None;
        }
        self.undisputed += 1;
        if self.undisputed >= JUDGE_EVERY {
            self.undisputed = 0;
            // Whichever explains the picture better is the reference for the next frames.
            let was_on_map = self.on_map;
            let (is_better, keyframe) = self.judge(pose, image);
            self.on_map = is_better;
            if was_on_map && !self.on_map {
                return keyframe;
            }
        }
        let view = if self.on_map { self.map.sharp_view(pose) } else { None };
        self.figures.frames_on_map += usize::from(view.is_some());
        view
    }

    /// Whether the map explains a frame better than the nearest keyframe does, and that keyframe as a view. Without a keyframe
    /// nearby nothing speaks for the map, and the tracker goes on with keyframes of its own.
    fn judge(&mut self, pose: &RigidTransform, image: &RgbdFrame) -> (bool, Option<SharpView>) {
        let relocaliser = self.loops.relocaliser();
        let Some(keyframe) = self.map.nearest_other(pose, image.index) else { return (false, None) };
        let keyframe = &self.map.bundle.frames[keyframe];
        let keyframe_view = relocaliser.keyframe_view(keyframe, self.map.sensor.depth_scale);
        let mut residual = |view: &SharpView| {
            relocaliser.align_to(image, view, pose).map(|measurement| measurement.residual)
        };
        // Both are aligned with the same frame from the same pose.
        let on_keyframe = residual(&keyframe_view);
        let on_map = self.map.sharp_view(pose).and_then(|view| residual(&view));
        let is_better = match (on_map, on_keyframe) {
            (Some(map), Some(keyframe)) => map < MAP_IS_BETTER * keyframe,
            (on_map, _) => on_map.is_some(),
        };
        (is_better, Some(keyframe_view))
    }

    /// Looks for the frames that were lost among all keyframes.
    pub(super) fn find_lost(&mut self, dataset: &Dataset) {
        let is_lost = |record: &FrameRecord| record.status == FrameStatus::Lost;
        let records = self.writer.record().frames().iter().enumerate();
        let lost: Vec<usize> =
            records.filter(|(_, record)| is_lost(record)).map(|(index, _)| index).collect();
        for index in lost {
            let found = dataset.frame(index).ok().and_then(|image| self.loops.find(&self.map, &image));
            if let Some(pose) = found.and_then(|view| view.start_from) {
                self.writer.record_mut().recover(index, &pose);
            }
        }
    }

    /// An exposure that was estimated when the world had moved `moves` times.
    fn in_this_world(&self, exposure: &TimedExposure, moves: usize) -> TimedExposure {
        self.moves[moves.min(self.moves.len())..]
            .iter()
            .fold(*exposure, |exposure, new_world_from_world| exposure.seen_from(new_world_from_world))
    }
}

/// The images of keyframes, from the data set.
pub(super) fn keyframe_images(
    dataset: &Dataset,
    saved: &[SavedKeyframe],
) -> Result<Vec<RgbdFrame>, SlamError> {
    let image = |saved: &SavedKeyframe| {
        let unusable = |reason: String| SlamError::Keyframe { index: saved.index, reason };
        dataset.frame(saved.index).map_err(|error| unusable(error.to_string()))
    };
    saved.iter().map(image).collect()
}

/// Keyframes from their images.
pub(super) fn keyframes(
    sensor: &Sensor,
    saved: &[SavedKeyframe],
    images: &[RgbdFrame],
) -> Result<Vec<MapKeyframe>, SlamError> {
    let keyframe = |(saved, image): (&SavedKeyframe, &RgbdFrame)| {
        let reason = || "its size is not the camera's".to_owned();
        let observation = ObservationPyramid::new(sensor, image, LEVELS)
            .ok_or_else(|| SlamError::Keyframe { index: saved.index, reason: reason() })?;
        let prior = PathPrior { middle: pose(saved.middle), is_measured: true, motion: None };
        Ok(MapKeyframe::new(saved.index, observation, prior))
    };
    saved.iter().zip(images).map(keyframe).collect()
}
