//! The mapper's side of the loop.

use mba_tracker::geometry::RigidTransform;

use super::driver::SlamProgress;
use super::growing_map::GrowingMap;
use super::messages::{Instruction, MapperLink, TrackedFrame};
use super::settings::{SlamReference, SlamSettings};
use crate::dataset::Dataset;
use crate::mapping::sensor;
use crate::run::{FrameStatus, RunError, RunWriter};
use crate::trajectory_file::TimedExposure;

/// Takes tracked frames, grows the map, and tells the tracker what to do.
pub(super) struct BackEnd {
    map: GrowingMap,
    settings: SlamSettings,
    writer: RunWriter,
    /// Every move of the world so far, `new_world_from_world`.
    moves: Vec<RigidTransform>,
}

impl BackEnd {
    pub(super) fn new(dataset: &Dataset, settings: &SlamSettings, writer: RunWriter) -> Self {
        let map = GrowingMap::new(sensor(dataset), settings);
        Self { map, settings: *settings, writer, moves: Vec::new() }
    }

    /// Works until the tracker has no more frames.
    pub(super) fn run(
        &mut self,
        link: MapperLink,
        observe: &mut impl FnMut(SlamProgress),
    ) -> Result<(), RunError> {
        for frame in link.frames {
            let instruction = self.take(frame)?;
            // A tracker that is gone needs no instructions.
            let _ = link.instructions.send(instruction);
            observe(SlamProgress::Frames {
                frames: self.writer.exposures().len(),
                keyframes: self.map.bundle.keyframes().len(),
                gaussians: self.map.bundle.state.gaussians.len(),
            });
        }
        Ok(())
    }

    /// The map and the run.
    pub(super) fn finish(self) -> (GrowingMap, RunWriter) {
        (self.map, self.writer)
    }

    fn take(&mut self, frame: TrackedFrame) -> Result<Instruction, RunError> {
        let exposure = self.in_this_world(&frame.exposure, frame.moves);
        if let Some((index, revised, blur_px)) = frame.revision {
            let revised = self.in_this_world(&revised, frame.moves);
            self.writer.revise(index, revised, blur_px);
            self.map.revise(index, &revised);
        }
        let Some(image) = frame.image else {
            let reason = frame.skipped.unwrap_or_default();
            self.writer.warn(format!("frame {} skipped: {reason}", frame.index));
            self.writer.push_skipped(exposure, frame.record)?;
            return Ok(Instruction::default());
        };
        self.writer.push(exposure, frame.record)?;
        if frame.record.status == FrameStatus::Lost {
            return Ok(Instruction::default());
        }
        if frame.record.status == FrameStatus::Ok {
            self.map.take(&exposure, frame.record.blur_px, &image);
        }
        self.map.work(&exposure.mid);
        let wanted = self.settings.reference == SlamReference::Map && self.map.is_mature(&exposure.mid);
        let reference = if wanted { self.map.sharp_view(&exposure.mid) } else { None };
        Ok(Instruction { world_move: None, reference })
    }

    /// An exposure that was estimated when the world had moved `moves` times.
    fn in_this_world(&self, exposure: &TimedExposure, moves: usize) -> TimedExposure {
        self.moves[moves.min(self.moves.len())..]
            .iter()
            .fold(*exposure, |exposure, new_world_from_world| exposure.seen_from(new_world_from_world))
    }
}
