//! Brightness of each frame relative to the others, from the gains that the tracker reports.

use super::window::Tracked;

/// Brightnesses of neighbours differ by a factor of at most this, unless the light was switched or a gain misread.
const MAX_STEP: f64 = 2.0;

/// Range of brightness over a recording that counts as constant: the noise of a gain.
const CONSTANT: f64 = 1.04;

/// Brightness of each of `frames` frames, mean 1 in the logarithm: gains are chained from keyframe to keyframe. Lost
/// frames get that of the frame before them. All are 1 where brightness does not vary, or not plausibly.
pub(super) fn relative_brightness(tracked: &[Tracked], frames: usize) -> Vec<f64> {
    let mut known: Vec<Option<f64>> = vec![None; frames];
    let mut last = 1.0;
    for frame in tracked {
        // A gain is relative to the frame that it was measured against, whose brightness is known by then.
        let chained =
            known[frame.reference].filter(|_| frame.is_found).map(|reference| reference * frame.gain);
        let step = |value: &f64| (1.0 / MAX_STEP..=MAX_STEP).contains(&(value / last));
        let is_plausible = |value: &f64| frame.gain > 0.0 && step(value);
        if let Some(value) = chained.filter(is_plausible) {
            last = value;
        }
        known[frame.index] = Some(last);
    }
    // Frames that were not tracked get the brightness before them.
    let mut before = 1.0;
    let filled: Vec<f64> = known
        .into_iter()
        .map(|value| {
            before = value.unwrap_or(before);
            before
        })
        .collect();
    let (least, most) = filled.iter().fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
    if most / least < CONSTANT {
        return vec![1.0; frames];
    }
    // Relative to the geometric mean, so that exposures vary around the one that is sought.
    let mean = filled.iter().map(|value| value.ln()).sum::<f64>() / frames as f64;
    filled.iter().map(|value| value / mean.exp()).collect()
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use mba_tracker::trajectory::ExposureTrajectory;

    use super::*;

    fn frame(index: usize, reference: usize, gain: f64) -> Tracked {
        let pose = RigidTransform::identity();
        Tracked {
            index,
            timestamp: index as f64,
            is_found: true,
            world_from_mid: pose,
            world_from_camera: ExposureTrajectory::still(pose),
            reference,
            gain,
            residual: 1.0,
        }
    }

    #[test]
    fn gains_are_chained_over_keyframes() {
        // Frame 2 is twice as bright as frame 0 and becomes the keyframe of frame 3.
        let tracked =
            [frame(0, 0, 1.0), frame(1, 0, 1.5), frame(2, 0, 2.0), frame(3, 2, 1.25), frame(4, 2, 30.0)];
        let found = relative_brightness(&tracked, 6);
        let over_first: Vec<f64> = found.iter().map(|value| value / found[0]).collect();
        for (value, expected) in over_first.iter().zip([1.0, 1.5, 2.0, 2.5, 2.5, 2.5]) {
            assert!((value - expected).abs() < 1e-12, "{over_first:?}");
        }
        let mean: f64 = found.iter().map(|value| value.ln()).sum();
        assert!(mean.abs() < 1e-12);
    }

    #[test]
    fn noise_is_no_change() {
        let tracked = [frame(0, 0, 1.0), frame(1, 0, 1.01), frame(2, 0, 0.99)];
        assert_eq!(relative_brightness(&tracked, 3), [1.0; 3]);
    }
}
