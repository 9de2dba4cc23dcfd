//! Exposure time from motion: what moved within an exposure, over the velocity that the poses around it give.

use mba_tracker::geometry::PinholeCamera;
use nalgebra::Vector6;

use super::motion::motion;
use super::robust::{Spread, median, spread};
use super::window::Tracked;

/// Least motion from frame to frame, pixels, for a frame to say anything: its blur is then about as long as the
/// uncertainty of a path.
const MIN_MOTION_PX: f64 = 3.0;

/// Fewest frames with enough motion.
const MIN_FRAMES: usize = 5;

/// Two exposure times tell a power when their logarithms are this far apart, and half of the frames when this many pairs
/// of them do.
const MIN_LOG_STEP: f64 = 0.1;
const MIN_SLOPES: usize = 20;

/// Powers between an assumed and a usual response, and their standard deviation around 1.
const POWERS: std::ops::RangeInclusive<f64> = 0.5..=2.0;
const POWER_SIGMA: f64 = 0.4;

/// Turns motions (translation in metres, rotation in radians) into pixels at a typical depth.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelScale {
    /// Pixels per radian.
    pub(super) focal: f64,
    /// Metres.
    pub(super) depth: f64,
}

impl PixelScale {
    pub(super) fn new(camera: &PinholeCamera, depth: f64) -> Self {
        Self { focal: 0.5 * (camera.fx + camera.fy), depth }
    }

    fn pixels(&self, motion: &Vector6<f64>) -> Vector6<f64> {
        let metre = self.focal / self.depth;
        Vector6::from_fn(|i, _| motion[i] * if i < 3 { metre } else { self.focal })
    }
}

/// Exposure times that single frames tell, seconds, with the pixels that the picture moves between two frames.
pub(super) fn observations(tracked: &[Tracked], scale: &PixelScale, interval: f64) -> Vec<(usize, f64, f64)> {
    let observe = |k: usize| {
        let frame = &tracked[k];
        let rate = scale.pixels(&motion(tracked, k).filter(|_| frame.is_found)?.velocity);
        let motion = interval * rate.norm();
        let within = scale.pixels(&frame.world_from_camera.motion());
        (motion >= MIN_MOTION_PX).then(|| (frame.index, within.dot(&rate) / rate.norm_squared(), motion))
    };
    (0..tracked.len()).filter_map(observe).collect()
}

/// The factor on all of `exposures` (of the data set's frames, seconds) that makes them agree with the motion.
pub(super) fn factor(observations: &[(usize, f64, f64)], exposures: &[f64]) -> Option<Spread> {
    if observations.len() < MIN_FRAMES {
        return None;
    }
    let ratios: Vec<f64> =
        observations.iter().map(|(index, seconds, _)| seconds / exposures[*index]).collect();
    spread(&ratios)
}

/// The power of `exposures` that the motion follows, where their ratios come from brightness through an assumed response.
/// A response is known up to a power as long as no exposure times are; motion tells them.
///
/// The median of the slopes between all pairs of frames on logarithmic axes, after Theil and Sen, drawn towards 1 as far as
/// the two halves of the frames contradict each other. None where exposures hardly vary, or for a power that no response
/// has.
pub(super) fn power(observations: &[(usize, f64, f64)], exposures: &[f64]) -> Option<f64> {
    let point = |(index, seconds, _): &(usize, f64, f64)| (exposures[*index].ln(), seconds.max(1e-4).ln());
    let points: Vec<(f64, f64)> = observations.iter().map(point).collect();
    let slope = |points: &[(f64, f64)]| {
        let pairs = points.iter().enumerate().flat_map(|(k, a)| points[..k].iter().map(move |b| (a, b)));
        let slopes: Vec<f64> = pairs
            .filter(|(a, b)| (a.0 - b.0).abs() > MIN_LOG_STEP)
            .map(|(a, b)| (a.1 - b.1) / (a.0 - b.0))
            .collect();
        if slopes.len() < MIN_SLOPES { None } else { median(&slopes) }
    };
    let half = |which: usize| points.iter().skip(which).step_by(2).copied().collect::<Vec<_>>();
    let (even, odd) = (slope(&half(0))?, slope(&half(1))?);
    let found = slope(&points)?;
    // Each half is off by sqrt(2) times as much as the whole, their difference by twice as much.
    let variance = 0.25 * (even - odd) * (even - odd);
    let share = POWER_SIGMA * POWER_SIGMA / (POWER_SIGMA * POWER_SIGMA + variance);
    POWERS.contains(&found).then_some(1.0 + share * (found - 1.0))
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use mba_tracker::trajectory::ExposureTrajectory;

    use super::*;

    const SCALE: PixelScale = PixelScale { focal: 500.0, depth: 2.0 };
    const INTERVAL: f64 = 1.0 / 30.0;

    /// A hand that shakes at 3 Hz; exposures last 9 ms.
    fn pose(t: f64) -> RigidTransform {
        let phase = std::f64::consts::TAU * 3.0 * t;
        let motion = Vector6::new(0.02 * phase.cos(), 0.0, 0.01, 0.0, 0.05 * phase.sin(), 0.0);
        RigidTransform::identity().perturbed(&motion)
    }

    fn shaken(frames: usize) -> Vec<Tracked> {
        let frame = |index: usize| {
            let timestamp = index as f64 * INTERVAL;
            Tracked {
                index,
                timestamp,
                is_found: true,
                world_from_mid: pose(timestamp),
                world_from_camera: ExposureTrajectory {
                    start: pose(timestamp - 0.0045),
                    end: pose(timestamp + 0.0045),
                },
                reference: 0,
                gain: 1.0,
                residual: 1.0,
            }
        };
        (0..frames).map(frame).collect()
    }

    #[test]
    fn exposure_time_follows_from_motion_whatever_was_assumed() {
        let tracked = shaken(40);
        let observations = observations(&tracked, &SCALE, INTERVAL);
        for assumed in [0.005, 0.0166] {
            let factor = factor(&observations, &[assumed; 40]).unwrap();
            let seconds = factor.median * assumed;
            assert!((seconds - 0.009).abs() < 1e-4, "{seconds}");
        }
    }

    #[test]
    fn lost_neighbours_and_stillness_say_nothing() {
        let mut tracked = shaken(5);
        assert!(motion(&tracked, 2).is_some());
        tracked[3].is_found = false;
        assert!(motion(&tracked, 2).is_none());
        assert!(motion(&tracked, 0).is_none(), "no frame before the first");
        let still: Vec<Tracked> = shaken(20)
            .into_iter()
            .map(|frame| Tracked { world_from_mid: RigidTransform::identity(), ..frame })
            .collect();
        let observations = observations(&still, &SCALE, INTERVAL);
        assert_eq!(observations.len(), 0);
        assert!(factor(&observations, &[0.01; 20]).is_none());
    }

    #[test]
    fn motion_tells_the_power_of_a_response() {
        // Brightness through a wrong response: true times are the 1.4th power of what it says.
        let exposures: Vec<f64> = (0..30).map(|k| 0.006 * 1.03_f64.powi(k)).collect();
        let seconds = |k: usize| 3.0 * exposures[k].powf(1.4) * if k % 7 == 3 { 0.3 } else { 1.0 };
        let observations: Vec<(usize, f64, f64)> = (0..30).map(|k| (k, seconds(k), 10.0)).collect();
        let found = power(&observations, &exposures).unwrap();
        assert!((found - 1.4).abs() < 1e-6, "{found}");
        assert_eq!(power(&observations, &[0.01; 30]), None, "all alike");
        assert_eq!(power(&observations[..6], &exposures), None, "too few");
    }
}
