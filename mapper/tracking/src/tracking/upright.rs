//! A world that stands upright.

use mba_io::dataset::Dataset;
use mba_io::imu::inertial_fit;
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, UnitVector3, Vector3};

use crate::run::{FrameRecord, FrameStatus, UpSource, Upright};

/// Frames over which gravity is measured at a time: two seconds of a video. Biases and errors of orientations add up.
const STRETCH: usize = 60;

/// Standard deviation of a direction, radians, from which on it is not told: 5 degrees, which one sees.
const MAX_SIGMA: f64 = 0.087;

/// Error of a direction that an accelerometer beside the camera has anyway, radians: a degree of how it is mounted and
/// calibrated. That of a Kinect was 2.6 degrees off.
const SYSTEMATIC: f64 = 0.017;

/// A camera that looks along this much of its direction of up or more has no horizontal one: within 2 degrees.
const VERTICAL: f64 = 0.999_4;

/// The world in which z points up, the first camera is the origin, and x points where it looked, level; none of a
/// recording that does not tell. `up_in_first_camera` is believed in place of an accelerometer.
#[must_use]
pub fn upright_world(
    dataset: &Dataset,
    exposures: &[TimedExposure],
    records: &[FrameRecord],
    up_in_first_camera: Option<UnitVector3<f64>>,
) -> Option<(RigidTransform, Upright)> {
    let first = exposures.first()?.mid;
    let (up, how) = match up_in_first_camera {
        Some(up) => (first.rotation * up, Upright { source: UpSource::Given, sigma_degrees: None }),
        None => {
            let (up, sigma) = felt(dataset, exposures, records)?;
            let sigma_degrees = Some(sigma.to_degrees());
            (up, Upright { source: UpSource::Accelerometer, sigma_degrees })
        }
    };
    let rotation = standing(&up, &first.rotation);
    let origin = rotation * first.translation;
    Some((RigidTransform::new(rotation, -origin), how))
}

/// Up in the world of the poses and its standard deviation in radians: the weighted mean of what every stretch of them says.
fn felt(
    dataset: &Dataset,
    exposures: &[TimedExposure],
    records: &[FrameRecord],
) -> Option<(UnitVector3<f64>, f64)> {
    let imu = dataset.imu().filter(|imu| !imu.specific_forces().is_empty())?;
    let (mut sum, mut weight) = (Vector3::zeros(), 0.0);
    let frames: Vec<_> = exposures.iter().zip(records).collect();
    for found in frames.split(|(_, record)| record.status == FrameStatus::Lost) {
        for stretch in found.chunks(STRETCH) {
            let poses: Vec<_> =
                stretch.iter().map(|(exposure, _)| (exposure.timestamp, exposure.mid)).collect();
            let Some(fit) = inertial_fit(imu, &poses) else { continue };
            let precision = 1.0 / (fit.up_sigma * fit.up_sigma + SYSTEMATIC * SYSTEMATIC);
            sum += fit.up.into_inner() * precision;
            weight += precision;
        }
    }
    // The systematic part is the same in all.
    let sigma = (1.0 / weight).sqrt().max(SYSTEMATIC);
    let up = UnitVector3::try_new(sum, f64::MIN_POSITIVE)?;
    (sigma < MAX_SIGMA).then_some((up, sigma))
}

/// The rotation into a world whose z axis is `up`, and whose x axis is the level part of where the camera looks; of where
/// its upper edge points when it looks up or down.
fn standing(up: &UnitVector3<f64>, world_from_camera: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let ahead = world_from_camera * Vector3::z();
    let along = if ahead.dot(up).abs() > VERTICAL { world_from_camera * -Vector3::y() } else { ahead };
    let y = up.cross(&along).normalize();
    let x = y.cross(up);
    let rows = Matrix3::from_rows(&[x.transpose(), y.transpose(), up.transpose()]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows))
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::so3;

    use super::*;

    #[test]
    fn z_is_up_and_x_ahead() {
        // A camera held level: its y axis points down.
        let level = standing(&-Vector3::y_axis(), &UnitQuaternion::identity());
        assert!((level * Vector3::z() - Vector3::x()).norm() < 1e-12, "ahead is x");
        assert!((level * Vector3::x() + Vector3::y()).norm() < 1e-12, "right is -y");
        // Pitched down by 0.3 rad, in a world of its own.
        let pitched = so3::exp(&Vector3::new(-0.3, 0.0, 0.0));
        let world = so3::exp(&Vector3::new(0.4, -0.8, 0.2));
        let rotation = standing(&(world * -Vector3::y_axis()), &(world * pitched));
        let ahead = rotation * world * pitched * Vector3::z();
        assert!(ahead.y.abs() < 1e-12 && (ahead.z + 0.3_f64.sin()).abs() < 1e-12, "{ahead}");
    }

    #[test]
    fn a_camera_that_looks_down_has_its_upper_edge_ahead() {
        let down = standing(&-Vector3::z_axis(), &UnitQuaternion::identity());
        assert!((down * Vector3::z() + Vector3::z()).norm() < 1e-12);
        assert!((down * Vector3::y() + Vector3::x()).norm() < 1e-12);
    }
}
