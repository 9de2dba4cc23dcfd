//! How well the motion within the exposure was found.

use mba_io::statistics::quantile;
use mba_io::trajectory_file::TimedExposure;
use mba_raster::exposure::{blur_length, motion_of};
use mba_tracker::geometry::PinholeCamera;
use mba_tracker::trajectory::ExposureTrajectory;

use super::associate;

/// Frames with less true blur than this, in pixels, say nothing about a relative error or a direction.
pub const MIN_TRUE_BLUR_PX: f64 = 5.0;

/// True and estimated blur of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlurFrame {
    /// Blur length of the reference motion, pixels.
    pub reference_px: f64,
    /// Blur length of the estimated motion, pixels.
    pub estimate_px: f64,
    /// Whether the estimated motion runs forward in time, i.e. start and end are not swapped.
    pub same_direction: bool,
}

/// Blur figures of a sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct BlurEvaluation {
    /// One entry per pair, in order.
    pub frames: Vec<BlurFrame>,
    /// Frames with more than [`MIN_TRUE_BLUR_PX`]; the two figures below are over these.
    pub blurred_frames: usize,
    /// Median of `|estimate - reference| / reference`; `None` without blurred frames.
    pub median_relative_error: Option<f64>,
    /// Share (0 to 1) with the right direction of time; `None` without blurred frames.
    pub direction_share: Option<f64>,
}

/// Compares the exposures of `reference` and `estimate` (both ascending in time) that are at most `max_dt` seconds
/// apart; `median_depth` (metres, positive) is the distance at which blur is measured.
///
/// Motions are compared in the camera's own frame, so the two world frames need no alignment.
#[must_use]
pub fn evaluate_blur(
    reference: &[TimedExposure],
    estimate: &[TimedExposure],
    max_dt: f64,
    camera: &PinholeCamera,
    median_depth: f64,
) -> BlurEvaluation {
    let stamps = |list: &[TimedExposure]| list.iter().map(|e| e.timestamp).collect::<Vec<_>>();
    let pairs: Vec<_> = associate(&stamps(reference), &stamps(estimate), max_dt)
        .into_iter()
        .map(|m| (motion_of(&reference[m.reference]), motion_of(&estimate[m.estimate])))
        .collect();
    compare_motions(&pairs, camera, median_depth)
}

fn compare_motions(
    pairs: &[(ExposureTrajectory, ExposureTrajectory)],
    camera: &PinholeCamera,
    median_depth: f64,
) -> BlurEvaluation {
    let frame = |(reference, estimate): &(ExposureTrajectory, ExposureTrajectory)| BlurFrame {
        reference_px: blur_length(reference, camera, median_depth),
        estimate_px: blur_length(estimate, camera, median_depth),
        same_direction: motion_product(reference, estimate, median_depth) > 0.0,
    };
    let frames: Vec<BlurFrame> = pairs.iter().map(frame).collect();
    let blurred: Vec<&BlurFrame> = frames.iter().filter(|f| f.reference_px > MIN_TRUE_BLUR_PX).collect();
    let errors: Vec<f64> =
        blurred.iter().map(|f| (f.estimate_px - f.reference_px).abs() / f.reference_px).collect();
    let forward = blurred.iter().filter(|f| f.same_direction).count();
    BlurEvaluation {
        blurred_frames: blurred.len(),
        median_relative_error: quantile(&errors, 0.5),
        direction_share: (!blurred.is_empty()).then(|| forward as f64 / blurred.len() as f64),
        frames,
    }
}

/// Scalar product of two motions in square metres; a rotation counts as the path it moves a point at `depth`.
pub(super) fn motion_product(a: &ExposureTrajectory, b: &ExposureTrajectory, depth: f64) -> f64 {
    let translation = |e: &ExposureTrajectory| {
        e.mid().rotation.inverse_transform_vector(&(e.end.translation - e.start.translation))
    };
    translation(a).dot(&translation(b)) + depth * depth * a.rotation_vector().dot(&b.rotation_vector())
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::{RigidTransform, so3};
    use nalgebra::{Vector3, Vector6};

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5 };

    fn exposure(world: &RigidTransform, motion: [f64; 6]) -> ExposureTrajectory {
        // A motion of the camera in its own frame, carried into some world frame.
        let still =
            ExposureTrajectory::from_mid_and_motion(&RigidTransform::identity(), &Vector6::from(motion));
        still.seen_from(world)
    }

    fn somewhere() -> RigidTransform {
        RigidTransform::new(so3::exp(&Vector3::new(0.4, -2.0, 1.0)), Vector3::new(3.0, 2.0, 1.0))
    }

    #[test]
    fn blurred_frames_decide_the_figures() {
        let (here, there) = (RigidTransform::identity(), somewhere());
        let sideways = |metres: f64| [metres, 0.0, 0.0, 0.0, 0.0, 0.0];
        let pairs = [
            // 10 px, estimated 11, right direction.
            (exposure(&here, sideways(0.04)), exposure(&there, sideways(0.044))),
            // 20 px, estimated 18, right direction.
            (exposure(&here, sideways(0.08)), exposure(&there, sideways(0.072))),
            // 10 px, estimated 14, swapped.
            (exposure(&here, sideways(0.04)), exposure(&there, sideways(-0.056))),
            // 2 px: does not count.
            (exposure(&here, sideways(0.008)), exposure(&there, sideways(-0.1))),
        ];
        let e = compare_motions(&pairs, &CAMERA, 2.0);
        assert_eq!(e.blurred_frames, 3);
        assert!((e.median_relative_error.unwrap() - 0.1).abs() < 1e-9);
        assert!((e.direction_share.unwrap() - 2.0 / 3.0).abs() < 1e-12);
        assert!((e.frames[1].estimate_px - 18.0).abs() < 1e-9);
    }

    #[test]
    fn rotation_decides_the_direction_when_it_blurs_more() {
        // 0.02 rad at 2 m move the image like 40 mm, more than the 10 mm of opposite translation.
        let here = RigidTransform::identity();
        let reference = exposure(&here, [0.01, 0.0, 0.0, 0.0, 0.02, 0.0]);
        let estimate = exposure(&here, [-0.01, 0.0, 0.0, 0.0, 0.02, 0.0]);
        assert!(compare_motions(&[(reference, estimate)], &CAMERA, 2.0).frames[0].same_direction);
    }

    #[test]
    fn sharp_sequences_have_no_blur_figures() {
        let still = ExposureTrajectory::still(RigidTransform::identity());
        let e = compare_motions(&[(still, still)], &CAMERA, 2.0);
        assert_eq!((e.blurred_frames, e.median_relative_error, e.direction_share), (0, None, None));
    }
}
