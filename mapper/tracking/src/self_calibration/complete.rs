//! Completing a data set: exposure and readout times that are not on record.

use mba_io::dataset::{Calibration, Dataset, DatasetError, ExposureSource, Knowledge, Shutter, survey};
use mba_tracker::geometry::PinholeCamera;

use super::depth_lag::depth_lag;
use super::depth_time::{self, Measured};
use super::exposure::PixelScale;
use super::exposure_times::{ExposureSearch, ExposureTimes, Exposures, SHORTEST};
use super::finding::{Finding, Value};
use super::readout::{ReadoutSearch, depth_readout};
use super::robust::median;
use super::vignetting::{FallOff, fall_off};
use super::window::{Guess, Probe, Recording, Resolution, Window};
use crate::tracking::TrackingOptions;

/// Fewest frames that can tell anything.
const MIN_FRAMES: usize = 8;

/// Frames whose depth is looked at.
const DEPTH_SAMPLES: usize = 8;

/// Rows that follow each other take longer than this, seconds. Less may be what the rows of colour take longer than those of
/// depth.
const SHORTEST_READOUT: f64 = 8e-3;

/// Relative error of a readout from edges: of the polynomial between poses, and of depth's own edges.
const READOUT_SYSTEMATIC: f64 = 0.05;

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
    exposures: Exposures,
    readout: Option<Measured>,
    /// Time from the first row of depth to the last, seconds; none where it is on record or nothing tells.
    depth_readout: Option<f64>,
    /// Seconds by which depth is later than its timestamps.
    depth_delay: Option<Measured>,
    /// What the rows of colour take longer than those of depth.
    longer_than_depth: Option<Measured>,
    /// Pixels that depth lies beside colour; none where the picture does not tell.
    depth_shift: Option<[f64; 2]>,
    /// Fall-off of light; none where it is on record or nothing tells.
    fall_off: Option<FallOff>,
    /// Whether the frames say anything about the readout.
    readout_was_sought: bool,
}

impl Estimates {
    fn of(dataset: &Dataset) -> Self {
        let calibration = dataset.calibration();
        let (exposure_known, readout_known) = (is_exposure_known(calibration), is_readout_known(calibration));
        let mut found = Self {
            exposures: Exposures::NoMotion,
            readout: None,
            depth_readout: None,
            depth_delay: None,
            longer_than_depth: None,
            depth_shift: None,
            fall_off: None,
            readout_was_sought: !readout_known,
        };
        let Some(depth) = survey(dataset, DEPTH_SAMPLES).median_depth.filter(|_| dataset.len() >= MIN_FRAMES)
        else {
            return found;
        };
        let options = TrackingOptions::default();
        let mut guess = Guess::of(dataset);
        if let Some(lag) = depth_lag(dataset) {
            // Somewhere within half a frame of it, evenly: the edges tell more where they can.
            let sigma = (lag.delay_seconds / 12.0_f64.sqrt()).abs();
            found.depth_delay = Some(Measured { seconds: lag.delay_seconds, sigma });
            guess.depth_delay = lag.delay_seconds;
        }
        let recording = Recording { dataset, options: &options };
        let (window, mut probe) = recording.liveliest(guess);
        let seen = found.look_at_edges(&window, &probe);
        if seen != probe.guess {
            probe = window.probe(Resolution::Coarse, seen);
        }
        let scale = PixelScale::new(&calibration.camera, depth);
        if !readout_known && found.readout.is_none() {
            probe = found.find_readout(&window, scale, probe);
        }
        let search = ExposureSearch { window: &window, scale };
        let settled = if exposure_known { None } else { search.coarse(probe.clone()) };
        let exposures_are_told = settled.is_some();
        // The second look knows the motion better.
        probe = settled.unwrap_or(probe);
        probe.guess = found.look_at_edges(&window, &probe);
        if calibration.sources.vignetting == Knowledge::Assumed {
            found.fall_off = fall_off(&window, &probe.tracked);
        }
        if exposures_are_told {
            found.exposures = search.fine(probe);
        }
        found
    }

    /// What the edges of colour and depth tell. Returns the guess with it.
    fn look_at_edges(&mut self, window: &Window<'_>, probe: &Probe) -> Guess {
        let calibration = window.recording.dataset.calibration();
        let mut guess = probe.guess.clone();
        let Some(edges) = depth_time::find(window, &probe.tracked) else { return guess };
        self.depth_shift = Some(edges.shift);
        self.longer_than_depth = Some(edges.rows);
        if calibration.sources.depth_delay == Knowledge::Assumed && edges.delay.differs_from_none() {
            self.depth_delay = Some(edges.delay);
            guess.depth_delay = edges.delay.seconds;
        }
        let follow_each_other = edges.rows.differs_from_none() && edges.rows.seconds.abs() > SHORTEST_READOUT;
        if self.readout_was_sought && follow_each_other {
            // The motion that the edges are moved by is as uncertain as that of exposures.
            let sigma = edges.rows.sigma.hypot(READOUT_SYSTEMATIC * edges.rows.seconds);
            // Rows of depth are those on record, else none: the difference tells them from those of colour.
            guess.depth_readout = calibration.depth_readout_seconds;
            guess.readout = edges.rows.seconds + guess.depth_readout;
            self.readout = Some(Measured { seconds: guess.readout, sigma });
            self.depth_readout = None;
        }
        guess
    }

    /// The readout that motion tells where the edges do not. Returns the probe with it, tracked again if it changed.
    fn find_readout(&mut self, window: &Window<'_>, scale: PixelScale, probe: Probe) -> Probe {
        let calibration = window.recording.dataset.calibration();
        let depth_is_known = calibration.sources.depth_delay != Knowledge::Assumed;
        // What edges do not tell for certain is taken for none: both sensors roll, or neither.
        let longer = self.longer_than_depth.filter(|_| !depth_is_known);
        let longer_than_depth = longer.map(|rows| if rows.is_certain() { rows.seconds } else { 0.0 });
        let is_rolling = matches!(calibration.readout, Shutter::Rolling { .. });
        let search = ReadoutSearch { window, scale, guess: &probe.guess, longer_than_depth, is_rolling };
        let Some(found) = search.find() else { return probe };
        self.readout = Some(found);
        self.depth_readout = longer_than_depth.map(|longer| depth_readout(found.seconds, longer));
        let depth_readout = self.depth_readout.unwrap_or(probe.guess.depth_readout);
        window.probe(Resolution::Coarse, Guess { readout: found.seconds, depth_readout, ..probe.guess })
    }

    fn apply(&self, dataset: Dataset) -> Result<Dataset, DatasetError> {
        // Each estimate takes its place, and its source says that it is one.
        let mut calibration = dataset.calibration().clone();
        let exposure_known = is_exposure_known(&calibration);
        if let Some(found) = self.readout {
            calibration.readout = Shutter::Rolling { seconds: Some(found.seconds) };
            calibration.sources.readout = Knowledge::Estimated;
        }
        if let Some(seconds) = self.depth_readout {
            calibration.depth_readout_seconds = seconds;
            calibration.sources.depth_delay = Knowledge::Estimated;
        }
        if let Some(found) = self.depth_delay {
            calibration.depth_clock_seconds = found.seconds;
            calibration.sources.depth_delay = Knowledge::Estimated;
        }
        if let Some(found) = self.fall_off.filter(FallOff::is_worth_it) {
            calibration.vignetting = found.vignetting;
            calibration.sources.vignetting = Knowledge::Estimated;
        }
        // Nothing moves enough to blur, so that the shortest exposure does as well as any.
        if !exposure_known && self.exposures == Exposures::NoMotion {
            calibration.exposure = ExposureSource::Assumed { seconds: SHORTEST };
        }
        let mut dataset = dataset.with_calibration(calibration)?;
        if let Exposures::Told(found) = &self.exposures {
            dataset.set_exposures(found.seconds.clone())?;
        }
        Ok(dataset)
    }

    fn findings(&self, dataset: &Dataset) -> Vec<Finding> {
        let mut findings = Vec::new();
        if !is_exposure_known(dataset.calibration()) {
            findings.push(self.exposure_finding(dataset));
        }
        if self.readout_was_sought {
            findings.push(self.readout_finding(dataset.calibration()));
        }
        findings.extend(self.delay_finding());
        findings.extend(self.fall_off.as_ref().map(FallOff::finding));
        findings.extend(self.shift_finding(&dataset.calibration().camera));
        findings
    }

    fn exposure_finding(&self, dataset: &Dataset) -> Finding {
        let unknown =
            |note: String| Finding { fact: "exposure", knowledge: Knowledge::Assumed, value: None, note };
        let ExposureTimes { seconds, relative_sigma } = match &self.exposures {
            Exposures::Told(times) => times,
            Exposures::Untold => {
                let assumed = 1e3 * dataset.exposure_seconds(0);
                return unknown(format!(
                    "the rows tell the motion, whatever their exposure; {assumed:.1} ms are assumed"
                ));
            }
            Exposures::NoMotion => {
                return unknown("too little motion to tell; every frame is taken for sharp".into());
            }
        };
        // One figure for the table; the note has the range.
        let middle = median(seconds).unwrap_or(SHORTEST);
        let (least, most) = seconds.iter().fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
        let note = if least == most {
            "the same for all frames".to_owned()
        } else {
            format!("{:.1} to {:.1} ms, by the brightness of the frames", 1e3 * least, 1e3 * most)
        };
        let value = Some(Value { value: middle, sigma: relative_sigma * middle, printed: MILLISECONDS });
        Finding { fact: "exposure", knowledge: Knowledge::Estimated, value, note }
    }

    fn readout_finding(&self, calibration: &Calibration) -> Finding {
        let Some(found) = self.readout else {
            let note = match calibration.readout {
                Shutter::Global => "rows explain no more than a global shutter",
                Shutter::Rolling { .. } => "too little to tell; all rows are taken for exposed together",
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
            note: self.depth_readout.map_or_else(String::new, |seconds| {
                let is_measured = self.longer_than_depth.is_some_and(|rows| rows.is_certain());
                let why =
                    if is_measured { "as its jumps lie on the edges of colour" } else { "taken for alike" };
                format!("{:.1} ms of depth, {why}", 1e3 * seconds)
            }),
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
