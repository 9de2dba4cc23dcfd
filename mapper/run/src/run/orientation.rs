//! How a run is best looked at: which way is up, and from where to start.

use mba_io::trajectory_file::TimedExposure;
use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector3;

use super::{FrameRecord, FrameStatus, Upright};

/// The upward direction in the world of a run, of length 1: z where the run stands `upright`. Else the mean over its frames of
/// what is up in the image, since cameras are held upright more often than not; the opposite of y, up in the first image, where
/// that is no direction.
#[must_use]
pub fn up_direction(
    upright: Option<&Upright>,
    exposures: &[TimedExposure],
    frames: &[FrameRecord],
) -> Vector3<f64> {
    if upright.is_some() {
        return Vector3::z();
    }
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

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::super::UpSource;
    use super::*;

    #[test]
    fn what_is_known_of_up_counts_more_than_how_the_camera_was_held() {
        // A camera that lies on its side: up in its images is along x.
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let mid = RigidTransform { rotation, translation: Vector3::zeros() };
        let exposure = TimedExposure { timestamp: 0.0, start: mid, mid, end: mid };
        let frame = FrameRecord { keyframe: 1, ..FrameRecord::without_figures(0.0, FrameStatus::Ok) };
        assert!((up_direction(None, &[exposure], &[frame]) - Vector3::x()).norm() < 1e-12);
        let upright = Upright { source: UpSource::Accelerometer, sigma_degrees: Some(0.5) };
        assert_eq!(up_direction(Some(&upright), &[exposure], &[frame]), Vector3::z());
        assert_eq!(up_direction(None, &[], &[]), -Vector3::y());
    }
}
