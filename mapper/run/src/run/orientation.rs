//! How a run is best looked at: which way is up, and from where to start.

use mba_io::trajectory_file::TimedExposure;
use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector3;

use super::{FrameRecord, FrameStatus};

/// The upward direction in the world of a run, of length 1: the mean over its frames of what is up in the image, since cameras
/// are held upright more often than not. The opposite of y, up in the first image, where that is no direction.
#[must_use]
pub fn up_direction(exposures: &[TimedExposure], frames: &[FrameRecord]) -> Vector3<f64> {
    let ups = posed(exposures, frames).map(|(exposure, _)| exposure.mid.rotation * -Vector3::y());
    let mean = ups.sum::<Vector3<f64>>().normalize();
    if mean.iter().all(|x| x.is_finite()) { mean } else { -Vector3::y() }
}

/// Pose, camera-to-world, of the first keyframe, or of the first frame where there is none.
#[must_use]
pub fn start_view(exposures: &[TimedExposure], frames: &[FrameRecord]) -> Option<RigidTransform> {
    let keyframe = posed(exposures, frames).find(|(_, frame)| frame.keyframe != 0);
    keyframe.or_else(|| posed(exposures, frames).next()).map(|(exposure, _)| exposure.mid)
}

/// Frames that are not lost.
fn posed<'a>(
    exposures: &'a [TimedExposure],
    frames: &'a [FrameRecord],
) -> impl Iterator<Item = (&'a TimedExposure, &'a FrameRecord)> {
    exposures.iter().zip(frames).filter(|(_, frame)| frame.status != FrameStatus::Lost)
}
