//! Completing a data set: exposure and readout times that are not on record.

use std::ops::Range;

use mba_tracker::geometry::PinholeCamera;

use super::depth_time::{self, Measured};
use super::exposure::{self, PixelScale};
use super::finding::{Finding, Value};
use super::robust::median;
use super::search::{self, Probe, SHORTEST, Search};
use super::window::{self, Guess, Tracked, Window};
use crate::dataset::{
    Calibration, Dataset, DatasetError, ExposureSource, Knowledge, LONGEST_ASSUMED_EXPOSURE, Readout, survey,
};
use crate::tracking::TrackingOptions;

/// Frames that are tracked again and again, at the most.
const WINDOW: usize = 60;

/// Fewest frames that can tell anything.
const MIN_FRAMES: usize = 8;

/// Frames whose depth is looked at.
const DEPTH_SAMPLES: usize = 8;

/// Brightness explains the exposure times unless one time for all fits the motion better than it by this factor.
const BRIGHTNESS_DOUBT: f64 = 1.25;

/// Relative error of an exposure time that many frames share: of paths, and of the polynomial between poses.
const SYSTEMATIC: f64 = 0.02;

/// Rows that follow each other take longer than this, seconds. Less may be what the rows of colour take longer than those of
/// depth, so that the readout is left to what fits best.
const SHORTEST_READOUT: f64 = 6e-3;

/// Relative error of a readout from edges: of the polynomial between poses, and of depth's own edges.
const READOUT_SYSTEMATIC: f64 = 0.05;

/// Rounds of looking at edges.
const EDGE_ROUNDS: usize = 2;

/// Depth that lies further beside colour is worth telling: shares of the image's width, and how well that is known.
const TELLING_SHIFT: f64 = 0.005;
const SHIFT_SIGMA: f64 = 0.0015;

const MILLISECONDS: (f64, &str) = (1e3, "ms");

/// Whether exposure and readout times are known, so that [`complete`] has nothing to do.
#[must_use]
pub fn is_complete(dataset: &Dataset) -> bool {
    let calibration = dataset.calibration();
    is_exposure_known(calibration) && is_readout_known(calibration)
}

fn is_exposure_known(calibration: &Calibration) -> bool {
    calibration.sources.exposure != Knowledge::Assumed
}

fn is_readout_known(calibration: &Calibration) -> bool {
    calibration.sources.readout != Knowledge::Assumed && calibration.readout.readout_seconds().is_some()
}

/// Finds exposure and readout times that are not on record and returns the data set with them, and what was found. A
/// data set that is complete comes back as it is.
///
/// Without motion nothing can be found, and every frame is taken for sharp. The same recording gives the same result,
/// whatever the number of threads.
///
/// # Errors
/// [`DatasetError`] if what was found makes no sense for the data set, which tells of a defect.
pub fn complete(dataset: Dataset) -> Result<(Dataset, Vec<Finding>), DatasetError> {
    if is_complete(&dataset) {
        return Ok((dataset, Vec::new()));
    }
    let found = Estimates::of(&dataset);
    let findings = found.findings(&dataset);
    Ok((found.apply(dataset)?, findings))
}

/// What is known after the search.
struct Estimates {
    /// Seconds for each frame, and the relative standard deviation that they share; none without motion.
    exposures: Option<(Vec<f64>, f64)>,
    readout: Option<Measured>,
    /// Seconds by which depth is later than its timestamps.
    depth_delay: Option<Measured>,
    /// Pixels that depth lies beside colour; none where the picture does not tell.
    depth_shift: Option<[f64; 2]>,
    /// Whether the frames say anything about the readout.
    readout_was_sought: bool,
}

impl Estimates {
    fn of(dataset: &Dataset) -> Self {
        let calibration = dataset.calibration();
        let (exposure_known, readout_known) = (is_exposure_known(calibration), is_readout_known(calibration));
        let mut found = Self {
            exposures: None,
            readout: None,
            depth_delay: None,
            depth_shift: None,
            readout_was_sought: !readout_known,
        };
        let Some(depth) = survey(dataset, DEPTH_SAMPLES).median_depth.filter(|_| dataset.len() >= MIN_FRAMES)
        else {
            return found;
        };
        let options = TrackingOptions::default();
        let guess = Guess::of(dataset);
        let first = everything(dataset, &options, &guess);
        let range = liveliest(&first, dataset.len());
        let window = Window::read(dataset, range.clone());
        let scale = PixelScale::new(&calibration.camera, depth);
        let search = Search { dataset, options: &options, window: &window, scale };
        let mut guess = found.look_at_edges(&search, guess, within(&first, &range));
        let whole = range.len() == dataset.len();
        if !readout_known && found.readout.is_none() {
            found.readout = find_readout(&search, &mut guess, exposure_known, whole);
        }
        found.exposures = if exposure_known { None } else { find_exposures(&search, guess, whole) };
        found
    }

    /// What the edges of colour and depth tell, in two rounds: the second knows the motion better. Returns the guess with it.
    fn look_at_edges(&mut self, search: &Search<'_>, mut guess: Guess, tracked: &[Tracked]) -> Guess {
        let calibration = search.dataset.calibration();
        let is_delay_known = calibration.sources.depth_delay != Knowledge::Assumed;
        let mut tracked = tracked.to_vec();
        for _ in 0..EDGE_ROUNDS {
            let Some(edges) = depth_time::find(search.window, search.dataset, &tracked) else { break };
            self.depth_shift = Some(edges.shift);
            let before = guess.clone();
            if !is_delay_known && edges.delay.differs_from_none() {
                self.depth_delay = Some(edges.delay);
                guess.depth_delay = edges.delay.seconds;
            }
            let follow_each_other =
                edges.rows.differs_from_none() && edges.rows.seconds.abs() > SHORTEST_READOUT;
            if self.readout_was_sought && follow_each_other {
                // The motion that the edges are moved by is as uncertain as that of exposures.
                let sigma = edges.rows.sigma.hypot(READOUT_SYSTEMATIC * edges.rows.seconds);
                self.readout = Some(Measured { sigma, ..edges.rows });
                guess.readout = edges.rows.seconds;
            }
            let Some(probe) = search.probe(vec![guess.clone()]).pop().filter(|_| guess != before) else {
                break;
            };
            tracked = probe.tracked;
        }
        guess
    }

    fn apply(&self, dataset: Dataset) -> Result<Dataset, DatasetError> {
        let mut calibration = dataset.calibration().clone();
        let exposure_known = is_exposure_known(&calibration);
        if let Some(found) = self.readout {
            calibration.readout = Readout::Rolling { seconds: Some(found.seconds) };
            calibration.sources.readout = Knowledge::Estimated;
        }
        if let Some(found) = self.depth_delay {
            calibration.depth_clock_seconds = found.seconds;
            calibration.sources.depth_delay = Knowledge::Estimated;
        }
        if !exposure_known && self.exposures.is_none() {
            calibration.exposure = ExposureSource::Assumed { seconds: SHORTEST };
        }
        let mut dataset = dataset.with_calibration(calibration)?;
        if let Some((seconds, _)) = self.exposures.as_ref().filter(|_| !exposure_known) {
            dataset.set_exposures(seconds.clone())?;
        }
        Ok(dataset)
    }

    fn findings(&self, dataset: &Dataset) -> Vec<Finding> {
        let mut findings = Vec::new();
        if !is_exposure_known(dataset.calibration()) {
            findings.push(self.exposure_finding());
        }
        if self.readout_was_sought {
            findings.push(self.readout_finding(dataset.calibration()));
        }
        findings.extend(self.delay_finding());
        findings.extend(self.shift_finding(&dataset.calibration().camera));
        findings
    }

    fn exposure_finding(&self) -> Finding {
        let Some((seconds, relative)) = &self.exposures else {
            return Finding {
                fact: "exposure",
                knowledge: Knowledge::Assumed,
                value: None,
                note: "too little motion to tell; every frame is taken for sharp".into(),
            };
        };
        let middle = median(seconds).unwrap_or(SHORTEST);
        let (least, most) = seconds.iter().fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
        let note = if least == most {
            "the same for all frames".to_owned()
        } else {
            format!("{:.1} to {:.1} ms, by the brightness of the frames", 1e3 * least, 1e3 * most)
        };
        let value = Some(Value { value: middle, sigma: relative * middle, printed: MILLISECONDS });
        Finding { fact: "exposure", knowledge: Knowledge::Estimated, value, note }
    }

    fn readout_finding(&self, calibration: &Calibration) -> Finding {
        let Some(found) = self.readout else {
            let note = match calibration.readout {
                Readout::Global => "rows explain no more than a global shutter",
                Readout::Rolling { .. } => "too little to tell; all rows are taken for exposed together",
            };
            return Finding {
                fact: "readout",
                knowledge: Knowledge::Assumed,
                value: None,
                note: note.into(),
            };
        };
        Finding {
            fact: "readout",
            knowledge: Knowledge::Estimated,
            value: Some(Value { value: found.seconds, sigma: found.sigma, printed: MILLISECONDS }),
            note: String::new(),
        }
    }

    fn delay_finding(&self) -> Option<Finding> {
        let found = self.depth_delay?;
        Some(Finding {
            fact: "depth_delay",
            knowledge: Knowledge::Estimated,
            value: Some(Value { value: found.seconds, sigma: found.sigma, printed: MILLISECONDS }),
            note: "added to the timestamps of depth".into(),
        })
    }

    /// Depth that lies beside its colour, which is told but not mended: parallax differs from pixel to pixel.
    fn shift_finding(&self, camera: &PinholeCamera) -> Option<Finding> {
        let [x, y] = self.depth_shift?;
        let length = x.hypot(y);
        (length > TELLING_SHIFT * camera.width as f64).then(|| Finding {
            fact: "depth_shift",
            knowledge: Knowledge::Estimated,
            value: Some(Value { value: length, sigma: SHIFT_SIGMA * camera.width as f64, printed: (1.0, "px") }),
            note: format!(
                "({x:+.1}, {y:+.1}); depth is not registered to colour there; not mended, see the camera's own calibration"
            ),
        })
    }
}

/// Those of the tracked frames that lie in `range` of the data set.
fn within<'a>(tracked: &'a [Tracked], range: &Range<usize>) -> &'a [Tracked] {
    let first = tracked.partition_point(|frame| frame.index < range.start);
    let end = tracked.partition_point(|frame| frame.index < range.end);
    &tracked[first..end]
}

/// The readout with which the window is tracked best; the guess comes to have it.
fn find_readout(
    search: &Search<'_>,
    guess: &mut Guess,
    exposure_known: bool,
    whole: bool,
) -> Option<Measured> {
    let coarse = search.coarse_readout(guess, exposure_known)?;
    *guess = coarse.guess.clone();
    if !exposure_known && whole {
        guess.exposures = follow_brightness(&coarse.tracked, guess);
    }
    let start = search.probe(vec![guess.clone()]).pop();
    let readout = start.and_then(|start| search.refine_readout(start, exposure_known));
    let certain = readout.filter(search::Readout::is_certain);
    guess.readout = certain.map_or(0.0, |found| found.seconds);
    certain.map(|found| Measured { seconds: found.seconds, sigma: found.sigma })
}

/// Tracks every frame of the data set.
fn everything(dataset: &Dataset, options: &TrackingOptions, guess: &Guess) -> Vec<Tracked> {
    let frames = (0..dataset.len()).filter_map(|index| dataset.frame(index).ok());
    window::track(frames, &window::config(dataset, options, guess), guess)
}

/// The stretch of at most [`WINDOW`] frames that turns most.
fn liveliest(tracked: &[Tracked], frames: usize) -> Range<usize> {
    let turn = |pair: &[Tracked]| match pair {
        [before, after] if before.is_found && after.is_found => {
            let motion = before.world_from_mid.tangent_to(&after.world_from_mid);
            (after.index, motion.fixed_rows::<3>(3).norm())
        }
        _ => (pair[1].index, 0.0),
    };
    let mut turns = vec![0.0; frames];
    for (index, angle) in tracked.windows(2).map(turn) {
        turns[index] = angle;
    }
    let length = WINDOW.min(frames);
    let liveliness = |start: usize| median(&turns[start..start + length]).unwrap_or(0.0);
    let best = (0..=frames - length).max_by(|a, b| liveliness(*a).total_cmp(&liveliness(*b))).unwrap_or(0);
    best..best + length
}

/// Exposure times as the guess has them on the whole, with the brightness of the frames.
fn follow_brightness(tracked: &[Tracked], guess: &Guess) -> Vec<f64> {
    let count = guess.exposures.len();
    let mean = guess.exposures.iter().map(|seconds| seconds.ln()).sum::<f64>() / count as f64;
    search::by_brightness(tracked, count, mean.exp())
}

/// Exposure times whose ratios are a power of those given; their mean (of logarithms) stays.
fn raised(exposures: &[f64], power: f64) -> Vec<f64> {
    let mean = exposures.iter().map(|seconds| seconds.ln()).sum::<f64>() / exposures.len() as f64;
    exposures.iter().map(|seconds| (mean + power * (seconds.ln() - mean)).exp()).collect()
}

/// Exposure times of all frames, seconds, and their common relative standard deviation.
fn find_exposures(search: &Search<'_>, mut guess: Guess, whole: bool) -> Option<(Vec<f64>, f64)> {
    let start = search.probe(vec![guess.clone()]).pop()?;
    if whole {
        guess.exposures = follow_brightness(&start.tracked, &guess);
    }
    let start = search.probe(vec![guess]).pop()?;
    let (mut settled, _) = search.settle_exposure(start)?;
    let interval = 1.0 / search.dataset.calibration().frame_rate;
    let mut power = 1.0;
    if whole && search.dataset.calibration().sources.response == Knowledge::Assumed {
        let observed = exposure::observations(&settled.tracked, &search.scale, interval);
        if let Some(found) = exposure::power(&observed, &settled.guess.exposures) {
            power = found;
            let exposures = raised(&settled.guess.exposures, power);
            let start = search.probe(vec![Guess { exposures, ..settled.guess }]).pop()?;
            (settled, _) = search.settle_exposure(start)?;
        }
    }
    let Probe { guess, mut tracked, .. } = settled;
    if !whole {
        tracked = everything(search.dataset, search.options, &guess);
    }
    let exposures = raised(&follow_brightness(&tracked, &guess), power);
    let observed = exposure::observations(&tracked, &search.scale, interval);
    let by_brightness = exposure::factor(&observed, &exposures)?;
    let constant = vec![1.0; exposures.len()];
    let alike = exposure::factor(&observed, &constant)?;
    let is_plausible =
        by_brightness.sigma / by_brightness.median <= BRIGHTNESS_DOUBT * alike.sigma / alike.median;
    let (exposures, relative) = if is_plausible {
        (exposures, by_brightness.sigma / by_brightness.median)
    } else {
        let mean = guess.exposures.iter().map(|seconds| seconds.ln()).sum::<f64>() / exposures.len() as f64;
        (vec![mean.exp(); exposures.len()], alike.sigma / alike.median)
    };
    let capped = exposures.iter().map(|seconds| seconds.clamp(SHORTEST, LONGEST_ASSUMED_EXPOSURE)).collect();
    Some((capped, relative.hypot(SYSTEMATIC)))
}
