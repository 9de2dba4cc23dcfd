//! Fall-off of light towards the corners: the same patch of surface in different places of the image.

use mba_tracker::photometric::Vignetting;
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use super::finding::{Finding, Value};
use super::patches_of_light::{Patches, Shared};
use super::robust::median;
use super::window::{Guess, Recording, Tracked, Window};
use crate::tracking::TrackingOptions;
use mba_io::dataset::{Dataset, Knowledge};

/// Frames from the first of a pair to the second: far enough for a hand to have moved the view, near enough for it to be
/// the same one.
const APART: [usize; 5] = [2, 4, 7, 11, 16];

/// Fewest patches in a pair of frames, and in all pairs together, that tell anything.
const MIN_SHARED: usize = 20;
const MIN_SAMPLES: usize = 2000;

/// Rounds of a fit that changes little after the third.
const ROUNDS: usize = 12;

/// Deviations of a pair's patches beyond which one is left out: a gloss, a shadow, another surface.
const GATE: f64 = 1.5;

/// Deviations are at least this, so that rendered pictures without noise are not believed beyond their bytes.
const MIN_DEVIATION: f64 = 2e-3;

/// Patches beside each other and in several pairs share their errors: so many times the error of independent ones.
const CORRELATION: f64 = 2.0;

/// Error of the share of light in the corners: of itself, and of the light that is missing there, which a response that
/// differs from the one on record changes by as much.
const SYSTEMATIC: f64 = 0.005;
const RESPONSE_ERROR: f64 = 0.1;

/// Light that is missing in the corners is modelled from this share on, and from so many standard deviations.
const TELLING: f64 = 0.02;
const CERTAINTY: f64 = 3.0;

/// Largest standard deviation with which the corners count as seen, and the least light in them of any lens.
const MAX_SIGMA: f64 = 0.05;
const LEAST_LIGHT: f64 = 0.15;

/// What the window says about the fall-off of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FallOff {
    pub(super) vignetting: Vignetting,
    /// Standard deviation of the share of light in the corners.
    pub(super) sigma: f64,
}

impl FallOff {
    /// Share of the light that reaches the corners.
    fn in_corners(&self) -> f64 {
        self.vignetting.falloff(1.0)
    }

    /// Whether it is worth modelling.
    pub(super) fn is_worth_it(&self) -> bool {
        1.0 - self.in_corners() > TELLING.max(CERTAINTY * self.sigma)
    }

    pub(super) fn finding(&self) -> Finding {
        let Vignetting { a2, a4 } = self.vignetting;
        let note = if self.is_worth_it() {
            format!("in the corners: 1 {a2:+.3} r^2 {a4:+.3} r^4")
        } else {
            "in the corners; taken for all of it".to_owned()
        };
        let value = Value { value: self.in_corners(), sigma: self.sigma, printed: (100.0, "% of the light") };
        Finding { fact: "vignetting", knowledge: Knowledge::Estimated, value: Some(value), note }
    }
}

/// What to say where no fall-off was found.
fn unknown() -> Finding {
    let note = "too little is seen both in the middle and near the corners".to_owned();
    Finding { fact: "vignetting", knowledge: Knowledge::Assumed, value: None, note }
}

/// Looks for the fall-off of light of a data set in its liveliest stretch; returns what was found, and the fall-off if
/// there is one worth modelling.
#[must_use]
pub fn vignetting(dataset: &Dataset) -> (Finding, Option<Vignetting>) {
    let options = TrackingOptions::default();
    let recording = Recording { dataset, options: &options };
    let (window, probe) = recording.liveliest(Guess::of(dataset));
    match fall_off(&window, &probe.tracked) {
        Some(found) => (found.finding(), found.is_worth_it().then_some(found.vignetting)),
        None => (unknown(), None),
    }
}

/// Two places of the stored image that saw the same light, as squared distances from its middle.
struct Sample {
    log_ratio: f64,
    squared: [f64; 2],
}

/// The fall-off of light that a tracked window tells; none if it does not.
///
/// The logarithms of the light of one patch in two frames differ by those of the fall-off at its two places and of the
/// frames' brightness, which is the median of the pair.
pub(super) fn fall_off(window: &Window<'_>, tracked: &[Tracked]) -> Option<FallOff> {
    let pairs = pairs(window, tracked);
    let samples: usize = pairs.iter().map(Vec::len).sum();
    if samples < MIN_SAMPLES {
        return None;
    }
    fit(&pairs).filter(|found| {
        let least = found.vignetting.least();
        found.sigma < MAX_SIGMA && least > LEAST_LIGHT && found.in_corners() < 1.0 + MAX_SIGMA
    })
}

/// The samples of each pair of frames that share enough.
fn pairs(window: &Window<'_>, tracked: &[Tracked]) -> Vec<Vec<Sample>> {
    let dataset = window.recording.dataset;
    let calibration = dataset.calibration();
    let (camera, response) = (window.camera(), calibration.response.inverse());
    let patches: Vec<Option<Patches>> = tracked
        .par_iter()
        .map(|frame| {
            let image = window.frame(frame.index).filter(|_| frame.is_found)?;
            Some(Patches::of(image, &response, calibration.depth_scale))
        })
        .collect();
    // Each frame with later ones at several distances.
    let couples: Vec<[usize; 2]> = (0..tracked.len())
        .flat_map(|first| APART.map(|apart| [first, first + apart]))
        .filter(|[_, second]| *second < tracked.len())
        .collect();
    let pair = |&[first, second]: &[usize; 2]| {
        let (own, other) = (patches[first].as_ref()?, patches[second].as_ref()?);
        let shared = own.shared_with(other, [&tracked[first], &tracked[second]], &camera);
        let sample = |shared: &Shared| Sample {
            log_ratio: shared.log_ratio,
            squared: shared.pixels.map(|pixel| window.stored_radius_squared(pixel)),
        };
        (shared.len() >= MIN_SHARED).then(|| shared.iter().map(sample).collect())
    };
    couples.par_iter().filter_map(pair).collect()
}

/// Gauss-Newton on both coefficients; in every round the brightness of each pair is the median of what is left.
fn fit(pairs: &[Vec<Sample>]) -> Option<FallOff> {
    let mut vignetting = Vignetting::NONE;
    let mut covariance = Matrix2::zeros();
    for _ in 0..ROUNDS {
        let sums: Vec<(Matrix2<f64>, Vector2<f64>)> =
            pairs.par_iter().map(|pair| normal_equations(pair, &vignetting)).collect();
        let (normal, right) = sums
            .into_iter()
            .fold((Matrix2::zeros(), Vector2::zeros()), |(a, b), (normal, right)| (a + normal, b + right));
        covariance = normal.try_inverse()?;
        let step = covariance * right;
        vignetting = Vignetting { a2: vignetting.a2 + step.x, a4: vignetting.a4 + step.y };
        if vignetting.least().is_nan() || vignetting.least() <= 0.0 {
            return None;
        }
    }
    // In the corners r is 1, so that a2 and a4 count alike.
    let corner = Vector2::repeat(1.0);
    let independent = (corner.dot(&(covariance * corner))).max(0.0).sqrt();
    let missing = 1.0 - vignetting.falloff(1.0);
    let sigma = (CORRELATION * independent).hypot(SYSTEMATIC).hypot(RESPONSE_ERROR * missing);
    Some(FallOff { vignetting, sigma })
}

/// What a pair adds to the normal equations at a fall-off.
fn normal_equations(pair: &[Sample], vignetting: &Vignetting) -> (Matrix2<f64>, Vector2<f64>) {
    let residual = |sample: &Sample| {
        let [first, second] = sample.squared.map(|squared| vignetting.falloff(squared).ln());
        sample.log_ratio - (first - second)
    };
    let residuals: Vec<f64> = pair.iter().map(residual).collect();
    let brightness = median(&residuals).unwrap_or(0.0);
    let distances: Vec<f64> = residuals.iter().map(|residual| (residual - brightness).abs()).collect();
    // 1.4826 turns the median distance into the standard deviation of a normal distribution.
    let deviation = (1.4826 * median(&distances).unwrap_or(0.0)).max(MIN_DEVIATION);
    let gradient = |sample: &Sample| {
        let [first, second] = sample
            .squared
            .map(|squared| Vector2::new(squared, squared * squared) / vignetting.falloff(squared));
        first - second
    };
    let near: Vec<(Vector2<f64>, f64)> = pair
        .iter()
        .zip(&residuals)
        .map(|(sample, residual)| (sample, residual - brightness))
        .filter(|(_, residual)| residual.abs() < GATE * deviation)
        .map(|(sample, residual)| (gradient(sample), residual))
        .collect();
    // The brightness of the pair is free: only differences to its means tell.
    let count = near.len().max(1) as f64;
    let mean = near.iter().map(|(gradient, _)| gradient).sum::<Vector2<f64>>() / count;
    let weight = 1.0 / (deviation * deviation);
    near.iter().fold((Matrix2::zeros(), Vector2::zeros()), |(normal, right), (gradient, residual)| {
        let own = gradient - mean;
        (normal + own * own.transpose() * weight, right + own * (residual * weight))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of places over an image, with the light of a lens, a brightness per pair, and a gloss here and there.
    fn pairs_of(lens: &Vignetting) -> Vec<Vec<Sample>> {
        let pair = |k: usize| {
            let sample = |n: usize| {
                let squared = [(n * 37 % 101) as f64 / 100.0, (n * 53 % 97 + k) as f64 / 120.0];
                let [first, second] = squared.map(|squared| lens.falloff(squared).ln());
                // Noise of a few thousandths and every tenth patch a gloss.
                let noise = 0.004 * ((n * 29 % 13) as f64 - 6.0) / 6.0;
                let gloss = if n % 10 == 3 { 0.4 } else { 0.0 };
                Sample { log_ratio: first - second + 0.1 * k as f64 + noise + gloss, squared }
            };
            (0..300).map(sample).collect()
        };
        (0..12).map(pair).collect()
    }

    #[test]
    fn fall_off_is_found_in_spite_of_brightness_and_gloss() {
        let lens = Vignetting { a2: -0.35, a4: 0.05 };
        let found = fit(&pairs_of(&lens)).unwrap();
        assert!((found.vignetting.falloff(1.0) - 0.7).abs() < 0.005, "{found:?}");
        assert!((found.vignetting.falloff(0.5) - lens.falloff(0.5)).abs() < 0.005, "{found:?}");
        // A tenth of the light that is missing.
        assert!(found.is_worth_it() && (0.03..0.035).contains(&found.sigma), "{found:?}");
        assert!(found.finding().to_string().starts_with("vignetting 70."), "{}", found.finding());
    }

    #[test]
    fn a_lens_without_fall_off_is_left_as_it_is() {
        let found = fit(&pairs_of(&Vignetting::NONE)).unwrap();
        assert!((found.vignetting.falloff(1.0) - 1.0).abs() < 0.005 && !found.is_worth_it(), "{found:?}");
        assert!(found.finding().note.ends_with("taken for all of it"), "{}", found.finding());
    }
}
