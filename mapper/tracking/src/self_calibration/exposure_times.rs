//! Exposure times of all frames: the ones with which tracking finds as much motion within exposures as between them.

use mba_io::dataset::{Knowledge, LONGEST_ASSUMED_EXPOSURE};

use super::brightness::relative_brightness;
use super::exposure::{self, PixelScale};
use super::window::{Guess, Probe, Resolution, Tracked, Window};

/// Brightness explains the exposure times unless one time for all fits the motion better than it by this factor.
const BRIGHTNESS_DOUBT: f64 = 1.25;

/// Relative error of an exposure time that many frames share: of paths, and of the polynomial between poses.
const SYSTEMATIC: f64 = 0.02;

/// Relative change of the exposure time that is no more than noise. What is left to go may be several times as much, as the path
/// fills the time it is given.
const SETTLED: f64 = 0.01;

/// Rounds after which the exposure time agrees with the motion: of coarse pictures from any time on, and of fine ones from nearly
/// the right one on.
const COARSE_ROUNDS: usize = 1;
const FINE_ROUNDS: usize = 3;

/// A shorter last step (of the logarithm) is taken without another look at where it leads: a third of it may be missing,
/// which is less than [`SYSTEMATIC`].
const UNSEEN_STEP: f64 = 0.04;

/// A step tells whether the motion depends on the exposure when it was longer than this; it does when the motion took back this
/// share of it. Where rows tell the motion, whatever their exposure, it does not, and every step would lead to the next.
const TELLING_STEP: f64 = 0.05;
const MIN_TAKEN_BACK: f64 = 0.2;

/// Rounds after which the power of a response agrees with the motion, and the change that is no more than noise.
const POWER_ROUNDS: usize = 2;
const SAME_POWER: f64 = 0.05;

/// First step towards shorter exposures, as a multiple of what the motion says: from an exposure that is twice too long it finds
/// a tenth to a quarter less, as the path fills the time it is given.
const SHORTENING: f64 = 2.5;

/// Shortest exposure time of a guess, seconds.
pub(super) const SHORTEST: f64 = 1e-4;

/// Exposure times of frames, seconds, and how certain they are.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ExposureTimes {
    /// For each frame of the data set.
    pub(super) seconds: Vec<f64>,
    /// The relative standard deviation that they share.
    pub(super) relative_sigma: f64,
}

/// What the motion says about exposure times.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Exposures {
    /// Too little motion to look at.
    NoMotion,
    /// The motion does not depend on them: rows tell it, whatever their exposure.
    Untold,
    /// They were found.
    Told(ExposureTimes),
}

/// Where the search for exposure times ended.
struct Settled {
    probe: Probe,
    /// Whether the motion depends on them.
    is_told: bool,
}

/// Finds exposure times from a window that is tracked with the readout and the depth delay of a guess.
pub(super) struct ExposureSearch<'a> {
    pub(super) window: &'a Window<'a>,
    pub(super) scale: PixelScale,
}

impl ExposureSearch<'_> {
    /// Exposure times that agree with the motion of coarse pictures, from what tracking the window with a guess found; none
    /// without enough motion.
    pub(super) fn coarse(&self, mut start: Probe) -> Option<Probe> {
        if self.window.is_whole() {
            let exposures = follow_brightness(&start.tracked, &start.guess);
            if exposures != start.guess.exposures {
                start = self.window.probe(Resolution::Coarse, Guess { exposures, ..start.guess });
            }
        }
        Some(self.settle(Resolution::Coarse, start)?.probe)
    }

    /// Exposure times of all frames from those that coarse pictures tell, which is nearly all of it: a lens that is soft over
    /// a pixel or two makes the last few percent.
    pub(super) fn fine(&self, coarse: Probe) -> Exposures {
        let (Probe { guess, tracked: coarse }, power) = self.follow_response(coarse);
        let Some(settled) = self.settle(Resolution::Fine, self.window.probe(Resolution::Fine, guess)) else {
            return Exposures::NoMotion;
        };
        let Settled { probe: Probe { guess, tracked }, is_told } = settled;
        if !is_told {
            return Exposures::Untold;
        }
        let brightness = if self.window.is_whole() {
            follow_brightness(&coarse, &guess)
        } else {
            follow_brightness(&self.window.recording.track_everything(&guess), &guess)
        };
        self.judged(&guess, &tracked, raised(&brightness, power)).map_or(Exposures::NoMotion, Exposures::Told)
    }

    /// Exposure times by brightness, unless one time for all fits the motion better.
    fn judged(&self, guess: &Guess, tracked: &[Tracked], by_brightness: Vec<f64>) -> Option<ExposureTimes> {
        let observed = exposure::observations(tracked, &self.scale, self.interval());
        let varying = exposure::factor(&observed, &by_brightness)?;
        let alike = exposure::factor(&observed, &vec![1.0; by_brightness.len()])?;
        let (varying, alike) = (varying.sigma / varying.median, alike.sigma / alike.median);
        let (seconds, relative) = if varying <= BRIGHTNESS_DOUBT * alike {
            (by_brightness, varying)
        } else {
            (vec![mean(&guess.exposures); by_brightness.len()], alike)
        };
        let seconds = seconds.iter().map(|seconds| seconds.clamp(SHORTEST, LONGEST_ASSUMED_EXPOSURE));
        Some(ExposureTimes { seconds: seconds.collect(), relative_sigma: relative.hypot(SYSTEMATIC) })
    }

    /// Raises exposures that follow brightness through an assumed response to the power that the motion tells; also returns
    /// that power.
    fn follow_response(&self, mut probe: Probe) -> (Probe, f64) {
        let response = self.window.recording.dataset.calibration().sources.response;
        let mut whole_power = 1.0;
        if response != Knowledge::Assumed || !self.window.is_whole() {
            return (probe, whole_power);
        }
        // Paths lean towards what is supposed, so that the first power is too near to 1.
        for _ in 0..POWER_ROUNDS {
            let observed = exposure::observations(&probe.tracked, &self.scale, self.interval());
            let power = exposure::power(&observed, &probe.guess.exposures).unwrap_or(1.0);
            if (power - 1.0).abs() < SAME_POWER {
                break;
            }
            let Some(factor) = exposure::factor(&observed, &probe.guess.exposures) else { break };
            whole_power *= power;
            let exposures = raised(&probe.guess.exposures, power);
            let exposures =
                scaled(&Guess { exposures, ..probe.guess.clone() }, factor.median.max(0.5)).exposures;
            probe = self.window.probe(Resolution::Coarse, Guess { exposures, ..probe.guess });
        }
        (probe, whole_power)
    }

    /// Exposure times that agree with the motion, from those of `start` on: all are scaled together. None without enough
    /// motion.
    ///
    /// Rows and the smoothness of motion pull the path towards the exposure that is supposed, so a factor is too near to
    /// 1. Where none is found any more the exposure is right. It ends, too, where the motion does not depend on the exposure.
    fn settle(&self, resolution: Resolution, start: Probe) -> Option<Settled> {
        let rounds = match resolution {
            Resolution::Coarse => COARSE_ROUNDS,
            Resolution::Fine => FINE_ROUNDS,
        };
        let mut probe = start;
        let mut last: Option<(f64, f64)> = None;
        for round in 0.. {
            let observed = exposure::observations(&probe.tracked, &self.scale, self.interval());
            let step = exposure::factor(&observed, &probe.guess.exposures)?.median.max(0.05).ln();
            if step.abs() < SETTLED || round == rounds {
                break;
            }
            if let Some((before, taken)) = last
                && before.abs() > TELLING_STEP
                && (before - step) / taken < MIN_TAKEN_BACK
            {
                return Some(Settled { probe, is_told: false });
            }
            // Secant on the logarithm: how much of a step the motion took back the last time.
            let gain = match last {
                Some((before, taken)) => (taken / (before - step)).clamp(0.5, 4.0),
                None if step < 0.0 => SHORTENING,
                None => 1.0,
            };
            let taken = (step * gain).clamp(-1.2, 1.2);
            last = Some((step, taken));
            let guess = scaled(&probe.guess, taken.exp());
            if guess == probe.guess {
                break;
            }
            if taken.abs() < UNSEEN_STEP && resolution == Resolution::Fine {
                probe.guess = guess;
                break;
            }
            probe = self.window.probe(resolution, guess);
        }
        Some(Settled { probe, is_told: true })
    }

    /// Seconds between frames.
    fn interval(&self) -> f64 {
        1.0 / self.window.recording.dataset.calibration().frame_rate
    }
}

/// Mean of the logarithms.
fn mean(exposures: &[f64]) -> f64 {
    (exposures.iter().map(|seconds| seconds.ln()).sum::<f64>() / exposures.len() as f64).exp()
}

/// The guess with all exposure times multiplied.
fn scaled(guess: &Guess, factor: f64) -> Guess {
    let exposures = guess
        .exposures
        .iter()
        .map(|seconds| (seconds * factor).clamp(SHORTEST, LONGEST_ASSUMED_EXPOSURE))
        .collect();
    Guess { exposures, ..guess.clone() }
}

/// Exposure times as the guess has them on the whole, with the brightness of the frames.
fn follow_brightness(tracked: &[Tracked], guess: &Guess) -> Vec<f64> {
    let shares = relative_brightness(tracked, guess.exposures.len());
    let whole = mean(&guess.exposures);
    shares.into_iter().map(|share| (share * whole).clamp(SHORTEST, LONGEST_ASSUMED_EXPOSURE)).collect()
}

/// Exposure times whose ratios are a power of those given; their mean (of logarithms) stays.
fn raised(exposures: &[f64], power: f64) -> Vec<f64> {
    let mean = mean(exposures);
    exposures.iter().map(|seconds| mean * (seconds / mean).powf(power)).collect()
}
