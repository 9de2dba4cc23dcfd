//! Whether the motions within exposures are possible, without any ground truth.

use mba_io::trajectory_file::TimedExposure;
use mba_raster::exposure::{blur_length, motion_of};
use mba_tracker::geometry::PinholeCamera;
use mba_tracker::trajectory::ExposureTrajectory;
use serde::{Deserialize, Serialize};

use super::exposure::motion_product;

/// Pixels by which a motion may exceed that between two frames: poses are not exact, and a hand does not move evenly.
const MARGIN_PX: f64 = 2.0;

/// Blur from which on a motion has a direction, pixels.
const BLURRED_PX: f64 = 4.0;

/// Cosine between the motions of two neighbours below which the second goes back.
const BACKWARDS: f64 = -0.5;

/// How many motions within exposures cannot be, or are unlikely.
///
/// A shutter is open for at most the time between two frames, so a picture cannot move further during an exposure than from
/// one frame to the next; and a hand seldom reverses between two frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MotionPlausibility {
    /// Frames that were found between two others that were found.
    pub judged: usize,
    /// Those that move further during the exposure than to either neighbour.
    pub impossible: usize,
    /// Neighbours in time of which both are blurred.
    pub pairs: usize,
    /// Those that move in opposite directions. A hand that shakes does so now and then.
    pub reversing: usize,
}

/// Judges `exposures`, in the order of time; `is_found` by their index; at `median_depth` metres, positive.
#[must_use]
pub fn motion_plausibility(
    exposures: &[TimedExposure],
    is_found: impl Fn(usize) -> bool,
    camera: &PinholeCamera,
    median_depth: f64,
) -> MotionPlausibility {
    let length = |motion: &ExposureTrajectory| blur_length(motion, camera, median_depth);
    let between =
        |a: usize, b: usize| length(&ExposureTrajectory { start: exposures[a].mid, end: exposures[b].mid });
    let mut found = MotionPlausibility::default();
    for k in (1..exposures.len().saturating_sub(1)).filter(|k| (k - 1..=k + 1).all(&is_found)) {
        let within = length(&motion_of(&exposures[k]));
        // A shutter is open for a part of the time between two frames: more motion within it than between them is impossible.
        let outside = between(k - 1, k).max(between(k, k + 1));
        found.judged += 1;
        found.impossible += usize::from(within > outside + MARGIN_PX);
    }
    for k in (1..exposures.len()).filter(|k| is_found(k - 1) && is_found(*k)) {
        let [a, b] = [k - 1, k].map(|k| motion_of(&exposures[k]));
        if length(&a) > BLURRED_PX && length(&b) > BLURRED_PX {
            let product = |a, b| motion_product(a, b, median_depth);
            // The angle between two motions, turns weighted as what they move at the median depth.
            let cosine = product(&a, &b) / (product(&a, &a) * product(&b, &b)).sqrt();
            found.pairs += 1;
            found.reversing += usize::from(cosine < BACKWARDS);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use nalgebra::Vector3;

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5 };

    /// A camera at `x` metres that moves `motion` metres sideways during its exposure: 250 px per metre at 2 m.
    fn exposure(index: usize, x: f64, motion: f64) -> TimedExposure {
        let at = |x: f64| RigidTransform { translation: Vector3::new(x, 0.0, 0.0), ..Default::default() };
        let [start, mid, end] = [x - 0.5 * motion, x, x + 0.5 * motion].map(at);
        TimedExposure { timestamp: index as f64, start, mid, end }
    }

    fn judged(motions: &[f64], lost: Option<usize>) -> MotionPlausibility {
        // 10 px from frame to frame.
        let exposures: Vec<_> =
            motions.iter().enumerate().map(|(k, motion)| exposure(k, 0.04 * k as f64, *motion)).collect();
        motion_plausibility(&exposures, |k| Some(k) != lost, &CAMERA, 2.0)
    }

    #[test]
    fn a_motion_beyond_the_neighbours_is_impossible() {
        // 5 px, 13 px with 10 between frames, 5 px back, and 12 px, which is within the margin.
        let found = judged(&[0.02, 0.02, 0.052, -0.02, 0.046, 0.02], None);
        assert_eq!(found, MotionPlausibility { judged: 4, impossible: 1, pairs: 5, reversing: 2 });
    }

    #[test]
    fn lost_and_sharp_frames_are_not_judged() {
        let found = judged(&[0.02, 0.02, 0.052, -0.02, 0.02, 0.0], Some(2));
        assert_eq!(found, MotionPlausibility { judged: 1, impossible: 0, pairs: 2, reversing: 1 });
    }
}
