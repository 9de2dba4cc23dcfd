//! Readout time from motion: what moves while the rows are read, over the velocity that the poses of the frames give.
//!
//! A path that is sampled by rows tells how much the camera moved from the first row to the last. If the rows are supposed to
//! take too short a time, that is more than the velocity allows, and less if they are supposed to take too long. Where both
//! agree the time is right. Exposures are supposed to be short meanwhile: blur does not move the picture.

use rayon::prelude::*;

use super::depth_time::Measured;
use super::exposure::{self, PixelScale};
use super::exposure_times::SHORTEST;
use super::robust::Spread;
use super::window::{Guess, Resolution, Window};

/// Readouts that are tried, as shares of the time between frames, which is the longest that there can be.
const SHARES: [f64; 3] = [0.3, 0.6, 0.95];

/// Standard deviations by which rows have to move more than the shortest share allows: where somebody says that they follow each
/// other, and where nobody does. In the former case it is enough that they move more at all if their direction is told.
const MIN_CERTAINTY: f64 = 2.0;
const MIN_CERTAINTY_UNTOLD: f64 = 3.0;

/// Standard deviations by which the other direction of the rows has to be worse, or better; less for rows from the top, as nearly
/// all sensors have them, where somebody says that they follow each other.
const MIN_DIFFERENCE: f64 = 3.0;
const MIN_DIFFERENCE_FROM_TOP: f64 = 2.0;

/// Relative error of a readout: of paths, and of the polynomial between poses. More where the time between frames bounds it.
const SYSTEMATIC: f64 = 0.05;
const BOUNDED: f64 = 0.1;

/// What is looked at.
pub(super) struct ReadoutSearch<'a> {
    pub(super) window: &'a Window<'a>,
    pub(super) scale: PixelScale,
    /// Everything but the readouts.
    pub(super) guess: &'a Guess,
    /// What the rows of colour take longer than those of depth, seconds, if depth has rows.
    pub(super) longer_than_depth: Option<f64>,
    /// Whether it is known that the rows follow each other.
    pub(super) is_rolling: bool,
}

impl ReadoutSearch<'_> {
    /// The readout with which rows and poses agree; none where they agree with a global shutter, or with anything.
    pub(super) fn find(&self) -> Option<Measured> {
        let interval = 1.0 / self.window.recording.dataset.calibration().frame_rate;
        // The shortest share downwards and upwards tells the direction of the rows.
        let ends = [interval, -interval].map(|longest| SHARES[0] * longest);
        let factors: Vec<Option<Spread>> = ends.into_par_iter().map(|readout| self.factor(readout)).collect();
        let (down, up) = (factors[0]?, factors[1]?);
        let difference = (down.median - up.median) / down.sigma.hypot(up.sigma).max(f64::MIN_POSITIVE);
        let (first, sign) = if difference < -MIN_DIFFERENCE { (up, -1.0) } else { (down, 1.0) };
        let excess = (first.median - 1.0) / first.sigma.max(f64::MIN_POSITIVE);
        let has_direction = difference.abs() > MIN_DIFFERENCE;
        let is_told = match self.is_rolling {
            true => {
                let has_direction = has_direction || difference > MIN_DIFFERENCE_FROM_TOP;
                excess > MIN_CERTAINTY || (excess > 0.0 && has_direction)
            }
            false => excess > MIN_CERTAINTY_UNTOLD && has_direction,
        };
        if !is_told {
            return None;
        }
        // The factor falls through 1 where the readout is right: two more readouts enclose it.
        let [_, middle, longest] = SHARES.map(|share| sign * share * interval);
        let shares = crossing(first, self.factor(longest)?, || self.factor(middle))?;
        Some(Measured { seconds: sign * shares.seconds * interval, sigma: shares.sigma * interval })
    }

    /// Motion within the rows over that which the poses give, when rows take `readout` seconds.
    fn factor(&self, readout: f64) -> Option<Spread> {
        let depth_readout =
            self.longer_than_depth.map_or(self.guess.depth_readout, |longer| depth_readout(readout, longer));
        let exposures = vec![SHORTEST; self.guess.exposures.len()];
        let guess = Guess { readout, depth_readout, exposures, ..self.guess.clone() };
        let probe = self.window.probe(Resolution::Fine, guess);
        let interval = 1.0 / self.window.recording.dataset.calibration().frame_rate;
        let observed = exposure::observations(&probe.tracked, &self.scale, interval);
        exposure::factor(&observed, &probe.guess.exposures)
    }
}

/// Time of the rows of depth when those of colour take `readout` and `longer` more than it; none of the other direction.
pub(super) fn depth_readout(readout: f64, longer: f64) -> f64 {
    let depth = readout - longer;
    if depth * readout > 0.0 { depth } else { 0.0 }
}

/// Share of the time between frames at which the factors of [`SHARES`] fall below 1, with its standard deviation, or the longest
/// where they do not. The middle one is only asked for if they do.
fn crossing(shortest: Spread, longest: Spread, middle: impl FnOnce() -> Option<Spread>) -> Option<Measured> {
    let [first, second, last] = SHARES;
    if longest.median >= 1.0 {
        return Some(Measured { seconds: last, sigma: BOUNDED * last });
    }
    let middle = middle()?;
    let (before, after, start, length) = if middle.median < 1.0 {
        (shortest, middle, first, second - first)
    } else {
        (middle, longest, second, last - second)
    };
    // Linear between the two that enclose it.
    let slope = (before.median - after.median) / length;
    let share = start + (before.median - 1.0) / slope;
    let sigma = (before.sigma.max(after.sigma) / slope).hypot(SYSTEMATIC * share);
    Some(Measured { seconds: share, sigma })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The crossing of three factors, from the shortest share to the longest.
    fn crossing_of(values: [f64; 3]) -> Option<Measured> {
        let [shortest, middle, longest] = values.map(|median| Spread { median, sigma: 0.03 });
        crossing(shortest, longest, || Some(middle))
    }

    #[test]
    fn the_readout_is_where_rows_and_poses_agree() {
        let found = crossing_of([1.3, 1.1, 0.9]).unwrap();
        assert!((found.seconds - 0.775).abs() < 1e-12, "{found:?}");
        // 0.03 over a slope of 0.2 in 0.35, and a twentieth.
        assert!((found.sigma - 0.0525_f64.hypot(0.05 * 0.775)).abs() < 1e-12, "{found:?}");
        let found = crossing_of([1.3, 0.9, 0.7]).unwrap();
        assert!((found.seconds - 0.525).abs() < 1e-12, "{found:?}");
        assert_eq!(crossing_of([1.5, 1.3, 1.1]).unwrap().seconds, 0.95);
        let [more, less] = [1.3, 0.9].map(|median| Spread { median, sigma: 0.03 });
        assert_eq!(crossing(more, less, || None), None);
    }

    #[test]
    fn depth_has_rows_of_the_same_direction_or_none() {
        assert!((depth_readout(0.026, -0.004) - 0.03).abs() < 1e-15);
        assert!((depth_readout(-0.02, -0.004) + 0.016).abs() < 1e-15);
        assert_eq!(depth_readout(0.02, 0.021), 0.0);
    }
}
