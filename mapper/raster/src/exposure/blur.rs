//! How far a motion during the exposure smears what is seen.

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::trajectory::ExposureTrajectory;

use mba_io::trajectory_file::TimedExposure;

/// Points per image axis at which a blur length is sampled.
const GRID: usize = 5;

/// The linear motion between a recorded exposure's ends. Only the ends count: blur length and direction do not depend
/// on the path between them.
#[must_use]
pub fn motion_of(exposure: &TimedExposure) -> ExposureTrajectory {
    ExposureTrajectory { start: exposure.start, end: exposure.end }
}

/// Mean distance in pixels between where the cameras at opening and at closing see the same point, over a regular
/// grid of pixels of the mid-exposure camera whose points lie at depth `depth` (metres).
#[must_use]
pub fn blur_length(exposure: &ExposureTrajectory, camera: &PinholeCamera, depth: f64) -> f64 {
    let mid = exposure.mid();
    let start_from_mid = exposure.start.inverse().compose(&mid);
    let end_from_mid = exposure.end.inverse().compose(&mid);
    let mut sum = 0.0;
    for row in 0..GRID {
        for column in 0..GRID {
            let u = (column as f64 + 0.5) / GRID as f64 * camera.width as f64 - 0.5;
            let v = (row as f64 + 0.5) / GRID as f64 * camera.height as f64 - 0.5;
            // Where a point of mid exposure is seen at opening and at closing.
            let x_mid = camera.ray(u, v) * depth;
            let at_start = camera.project(&start_from_mid.transform_point(&x_mid));
            let at_end = camera.project(&end_from_mid.transform_point(&x_mid));
            sum += (at_end - at_start).norm();
        }
    }
    sum / (GRID * GRID) as f64
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::{RigidTransform, so3};
    use nalgebra::{Vector3, Vector6};

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5 };

    #[test]
    fn sideways_motion_blurs_by_focal_length_times_path_over_depth() {
        let motion = Vector6::from([0.04, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let exposure = ExposureTrajectory::from_mid_and_motion(&RigidTransform::identity(), &motion);
        // The frame of the world does not matter.
        let somewhere =
            RigidTransform::new(so3::exp(&Vector3::new(0.4, -2.0, 1.0)), Vector3::new(3.0, 2.0, 1.0));
        assert!((blur_length(&exposure.seen_from(&somewhere), &CAMERA, 2.0) - 10.0).abs() < 1e-9);
    }
}
