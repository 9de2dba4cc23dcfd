//! Finding readout and exposure time by tracking a window again and again.

use rayon::prelude::*;

use super::brightness::relative_brightness;
use super::exposure::{self, PixelScale};
use super::robust::Spread;
use super::score::{Parabola, advantage, misfits, parabola, trimmed_mean};
use super::window::{Guess, Tracked, Window};
use crate::dataset::{Dataset, LONGEST_ASSUMED_EXPOSURE};
use crate::tracking::TrackingOptions;

/// Readout times that are tried first, seconds: that of the slowest usual sensors, and steps in which the fit changes
/// by itself.
const READOUTS: [f64; 7] = [-0.03, -0.02, -0.01, 0.0, 0.01, 0.02, 0.03];

/// Exposure times that are tried with each of them, as shares of the assumed one.
const EXPOSURE_SHARES: [f64; 2] = [1.0, 0.5];

/// Steps around the best readout that are tried next, seconds; the second time around the bottom of the parabola.
const REFINEMENTS: [[f64; 4]; 2] = [[-0.006, -0.003, 0.003, 0.006], [-0.004, -0.002, 0.002, 0.004]];

/// A readout is believed when it differs from none, and explains the frames better than none, by this many standard
/// deviations, and by this share of the residual.
const MIN_CERTAINTY: f64 = 3.0;
const MIN_GAIN: f64 = 0.03;

/// Stretches of frames that are left out in turn to see how certain a readout is.
const BLOCKS: usize = 5;

/// Rounds after which the exposure time agrees with the motion, and the change that is no more than noise.
const EXPOSURE_ROUNDS: usize = 4;
const SETTLED: f64 = 0.01;

/// Shortest exposure time of a guess, seconds.
pub(super) const SHORTEST: f64 = 1e-4;

/// One try: what was supposed and what came of it.
#[derive(Clone, Debug)]
pub(super) struct Probe {
    pub(super) guess: Guess,
    pub(super) tracked: Vec<Tracked>,
    misfits: Vec<f64>,
}

impl Probe {
    /// Mean misfit.
    fn height(&self) -> f64 {
        trimmed_mean(&self.misfits).map_or(f64::INFINITY, |mean| mean.median)
    }
}

/// What the search works on.
pub(super) struct Search<'a> {
    pub(super) dataset: &'a Dataset,
    pub(super) options: &'a TrackingOptions,
    pub(super) window: &'a Window,
    pub(super) scale: PixelScale,
}

impl Search<'_> {
    /// Tracks the window once with each guess; in parallel, in order.
    pub(super) fn probe(&self, guesses: Vec<Guess>) -> Vec<Probe> {
        let try_one = |guess: Guess| {
            let tracked = self.window.track(self.dataset, self.options, &guess);
            Probe { misfits: misfits(&tracked), guess, tracked }
        };
        guesses.into_par_iter().map(try_one).collect()
    }

    /// Exposure times that agree with the motion when rows take the time of `start`, from its own exposures on: all are
    /// scaled together. Returns the last try and the factor's relative uncertainty; none without enough motion.
    ///
    /// Rows and the smoothness of motion pull the path towards the exposure that is supposed, so a factor is too near to
    /// 1. Where none is found any more the exposure is right.
    pub(super) fn settle_exposure(&self, start: Probe) -> Option<(Probe, f64)> {
        let interval = 1.0 / self.dataset.calibration().frame_rate;
        let mut probe = start;
        let mut last: Option<(f64, f64)> = None;
        for round in 0.. {
            let observed = exposure::observations(&probe.tracked, &self.scale, interval);
            let found = exposure::factor(&observed, &probe.guess.exposures)?;
            let step = found.median.max(0.05).ln();
            if step.abs() < SETTLED || round == EXPOSURE_ROUNDS {
                return Some((probe, found.sigma));
            }
            // Secant on the logarithm: how much of a step the motion took back the last time.
            let gain = match last {
                Some((before, taken)) => (taken / (before - step)).clamp(0.5, 4.0),
                None => 1.0,
            };
            let taken = (step * gain).clamp(-1.2, 1.2);
            last = Some((step, taken));
            let guess = scaled(&probe.guess, taken.exp());
            if guess == probe.guess {
                return Some((probe, found.sigma));
            }
            probe = self.probe(vec![guess]).pop()?;
        }
        None
    }

    /// The best of a coarse grid of readout and exposure times; exposures stay where `fixed_exposure`.
    pub(super) fn coarse_readout(&self, start: &Guess, fixed_exposure: bool) -> Option<Probe> {
        let shares = if fixed_exposure { &EXPOSURE_SHARES[..1] } else { &EXPOSURE_SHARES };
        let guesses = READOUTS.iter().flat_map(|readout| {
            shares.iter().map(|share| Guess { readout: *readout, ..scaled(start, *share) })
        });
        let best = |a: &Probe, b: &Probe| a.height().total_cmp(&b.height());
        self.probe(guesses.collect()).into_iter().min_by(best)
    }

    /// The readout around that of `start` that explains the frames best.
    pub(super) fn refine_readout(&self, start: Probe, fixed_exposure: bool) -> Option<Readout> {
        let mut best = start;
        let mut found = None;
        for steps in REFINEMENTS {
            if !fixed_exposure && let Some((settled, _)) = self.settle_exposure(best.clone()) {
                best = settled;
            }
            let around = best.guess.clone();
            let mut guesses: Vec<Guess> =
                steps.iter().map(|step| Guess { readout: around.readout + step, ..around.clone() }).collect();
            guesses.push(Guess { readout: 0.0, ..around.clone() });
            let mut probes = self.probe(guesses);
            let none = probes.pop()?;
            probes.push(best.clone());
            let lowest = probes.iter().min_by(|a, b| a.height().total_cmp(&b.height()))?.guess.readout;
            let reach = steps[3];
            let bounds = (around.readout - reach, around.readout + reach);
            let bottom = bottom_of(&probes, bounds, |_| true);
            let place = bottom.map_or(lowest, |p| p.bottom);
            // Places beyond the steps cannot be told apart where the points show no parabola.
            let of_points = bottom.map_or(reach, |p| p.sigma.max(0.1 * reach));
            let sigma = of_points.hypot(spread_over_blocks(&probes, bounds));
            let gain = advantage(&best.misfits, &none.misfits)?;
            found = Some(Readout { seconds: place, sigma, gain });
            best = self.probe(vec![Guess { readout: place, ..around }]).pop()?;
        }
        found
    }
}

/// Where the parabola through the misfits of the frames that `takes_part` (by number) is lowest, within `bounds`.
fn bottom_of(probes: &[Probe], bounds: (f64, f64), takes_part: impl Fn(usize) -> bool) -> Option<Parabola> {
    let height = |probe: &Probe| {
        let frames = probe.misfits.iter().enumerate().filter(|(k, _)| takes_part(*k));
        trimmed_mean(&frames.map(|(_, misfit)| *misfit).collect::<Vec<_>>()).map(|mean| mean.median)
    };
    let points: Option<Vec<(f64, f64)>> =
        probes.iter().map(|probe| Some((probe.guess.readout, height(probe)?))).collect();
    let found = parabola(&points?)?;
    Some(Parabola { bottom: found.bottom.clamp(bounds.0, bounds.1), ..found })
}

/// Standard deviation of the bottom by how much it changes when one stretch of frames is left out (the jackknife; frames of
/// a stretch share a keyframe, and what is wrong with it). The width of the bounds where there is no bottom without one.
fn spread_over_blocks(probes: &[Probe], bounds: (f64, f64)) -> f64 {
    let frames = probes.iter().map(|probe| probe.misfits.len()).min().unwrap_or(0);
    let length = frames.div_ceil(BLOCKS).max(1);
    let bottoms: Option<Vec<f64>> = (0..BLOCKS)
        .map(|block| bottom_of(probes, bounds, |k| k / length != block).map(|found| found.bottom))
        .collect();
    let Some(bottoms) = bottoms else { return bounds.1 - bounds.0 };
    let count = BLOCKS as f64;
    let mean = bottoms.iter().sum::<f64>() / count;
    let squares: f64 = bottoms.iter().map(|bottom| (bottom - mean).powi(2)).sum();
    ((count - 1.0) / count * squares).sqrt()
}

/// A readout time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Readout {
    /// First row to last, seconds.
    pub(super) seconds: f64,
    /// Its standard deviation.
    pub(super) sigma: f64,
    /// How much better it explains the frames than none, in the logarithm of the residual.
    gain: Spread,
}

impl Readout {
    /// Whether the recording tells it from none.
    pub(super) fn is_certain(&self) -> bool {
        let explains_more = self.gain.median > MIN_GAIN && self.gain.median > MIN_CERTAINTY * self.gain.sigma;
        explains_more && self.seconds.abs() > MIN_CERTAINTY * self.sigma
    }
}

/// The guess with all exposure times multiplied.
pub(super) fn scaled(guess: &Guess, factor: f64) -> Guess {
    let exposures = guess
        .exposures
        .iter()
        .map(|seconds| (seconds * factor).clamp(SHORTEST, LONGEST_ASSUMED_EXPOSURE))
        .collect();
    Guess { exposures, ..guess.clone() }
}

/// Exposure times of mean (of logarithms) `seconds` that follow the brightness of the frames.
pub(super) fn by_brightness(tracked: &[Tracked], frames: usize, seconds: f64) -> Vec<f64> {
    let times = relative_brightness(tracked, frames);
    times.into_iter().map(|share| (share * seconds).clamp(SHORTEST, LONGEST_ASSUMED_EXPOSURE)).collect()
}
