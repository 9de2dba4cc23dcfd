//! The frames of a run that have a pose.

use mba_tracker::geometry::RigidTransform;

use super::ExportError;
use crate::run::{FrameStatus, Run};

/// A frame with its pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosedFrame {
    /// Index in the data set.
    pub index: usize,
    /// Mid exposure, seconds.
    pub timestamp: f64,
    /// Pose at mid exposure.
    pub world_from_camera: RigidTransform,
    /// Whether it is a keyframe.
    pub is_keyframe: bool,
}

/// All frames of a run that have a pose, in order of time, and how many are left out because they are lost.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedFrames {
    /// At least one.
    pub frames: Vec<PosedFrame>,
    /// Number of lost frames.
    pub lost: usize,
}

impl PosedFrames {
    /// The frames of a run that are not lost.
    ///
    /// # Errors
    /// [`ExportError::Rows`], [`ExportError::NoPose`].
    pub fn of(run: &Run) -> Result<Self, ExportError> {
        let (exposures, frames) = (run.exposures.len(), run.frames.len());
        if exposures != frames {
            return Err(ExportError::Rows { folder: run.folder.clone(), exposures, frames });
        }
        let all = run.exposures.iter().zip(&run.frames).enumerate();
        // A lost frame holds the pose of the one before: other programs would take it for seen.
        let found = all.filter(|(_, (_, record))| record.status != FrameStatus::Lost);
        let frames: Vec<_> = found
            .map(|(index, (exposure, record))| PosedFrame {
                index,
                timestamp: exposure.timestamp,
                world_from_camera: exposure.mid,
                is_keyframe: record.keyframe != 0,
            })
            .collect();
        let lost = run.frames.len() - frames.len();
        if frames.is_empty() {
            return Err(ExportError::NoPose { folder: run.folder.clone(), lost });
        }
        Ok(Self { frames, lost })
    }
}

/// A frame turned by 90 degrees about z at (1, 2, 3) and 12.5 s, for tests.
#[cfg(test)]
pub(super) fn sample_frame() -> PosedFrame {
    use nalgebra::{UnitQuaternion, Vector3};
    let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    PosedFrame {
        index: 7,
        timestamp: 12.5,
        world_from_camera: RigidTransform::new(rotation, Vector3::new(1.0, 2.0, 3.0)),
        is_keyframe: true,
    }
}
