//! What the parts of the tracker are worth.

use std::time::Duration;

use mba_mapper::dataset::{Calibration, Dataset, DatasetError, Shutter};
use mba_mapper::run::Summary;
use serde::Serialize;

use super::super::repeats::{self, Repeats, Spread, nudged, spread, with_same_sensors};
use super::super::track;
use crate::args::{BlurMode, Reference, Switch, Tracking};
use crate::console::Console;
use crate::interrupt::Resumption;

/// Time between two checkpoints, seconds; a run takes about as long.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(20);

/// One row of the table; of each figure the middle, the least and the most of the runs.
#[derive(Clone, Debug, Serialize)]
struct Row {
    name: &'static str,
    runs: usize,
    ate_cm: Spread,
    length_error_percent: Spread,
    direction_percent: Spread,
    impossible: Spread,
    reversing_percent: Spread,
    lost: Spread,
}

/// What is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Nothing,
    Blur,
    Rows,
    DepthTerm,
    Deblurring,
    Imu,
    Hindsight,
}

impl Part {
    const ALL: [Self; 7] = [
        Self::Nothing,
        Self::Blur,
        Self::Rows,
        Self::DepthTerm,
        Self::Deblurring,
        Self::Imu,
        Self::Hindsight,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Nothing => "everything",
            Self::Blur => "blur off",
            Self::Rows => "rows off",
            Self::DepthTerm => "depth term off",
            Self::Deblurring => "reference raw",
            Self::Imu => "IMU off",
            Self::Hindsight => "hindsight off",
        }
    }

    /// Whether the data set has it at all.
    fn is_in(self, dataset: &Dataset) -> bool {
        match self {
            Self::Rows => {
                let Calibration { readout, depth_readout_seconds, .. } = dataset.calibration();
                readout.readout_seconds().is_some_and(|seconds| seconds != 0.0)
                    || *depth_readout_seconds != 0.0
            }
            // The accelerometer turns the world, it does not track.
            Self::Imu => dataset.imu().is_some_and(|imu| !imu.angular_velocities().is_empty()),
            _ => true,
        }
    }

    fn tracking(self) -> Tracking {
        let all = Tracking { keyframes: Switch::Off, ..Tracking::default() };
        match self {
            Self::Blur => Tracking { blur: BlurMode::Off, ..all },
            Self::DepthTerm => Tracking { depth_term: Switch::Off, ..all },
            Self::Deblurring => Tracking { reference: Reference::Raw, ..all },
            Self::Hindsight => Tracking { hindsight: Switch::Off, ..all },
            _ => all,
        }
    }

    fn left_out(self, dataset: Dataset) -> Result<Dataset, DatasetError> {
        match self {
            Self::Rows => {
                let mut calibration = dataset.calibration().clone();
                calibration.readout = Shutter::Global;
                calibration.depth_readout_seconds = 0.0;
                with_same_sensors(&dataset, calibration)
            }
            Self::Imu => Ok(dataset.without_imu("it is not used in this run".to_owned())),
            _ => Ok(dataset),
        }
    }
}

/// Tracks with each part left out in turn, as often as asked for, and prints a table.
///
/// # Errors
/// As `mba track`.
pub(super) fn run(dataset: &Dataset, repeats: Repeats<'_>, console: &Console) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for part in Part::ALL.into_iter().filter(|part| part.is_in(dataset)) {
        let summaries = repeats::summaries(repeats, part.name(), console, |repeat, out| {
            let dataset = part.left_out(nudged(dataset, repeat)?)?;
            let how = (false, Resumption::Always);
            track::track_into(&dataset, out, how, CHECKPOINT_INTERVAL, &part.tracking(), console)
        })?;
        rows.push(Row::new(part.name(), &summaries));
    }
    console.result(&rows, |rows| table(rows))
}

impl Row {
    fn new(name: &'static str, summaries: &[Summary]) -> Self {
        let of = |figure| spread(summaries, figure);
        Self {
            name,
            runs: summaries.len(),
            ate_cm: of(|summary| Some(100.0 * summary.trajectory.as_ref()?.ate_m.rmse)),
            length_error_percent: of(|summary| Some(100.0 * summary.blur.as_ref()?.median_relative_error?)),
            direction_percent: of(|summary| Some(100.0 * summary.blur.as_ref()?.direction_share?)),
            impossible: of(|summary| Some(summary.plausibility?.impossible as f64)),
            reversing_percent: of(|summary| {
                let found = summary.plausibility.filter(|found| found.pairs > 0)?;
                Some(100.0 * found.reversing as f64 / found.pairs as f64)
            }),
            lost: of(|summary| Some(summary.frames.lost as f64)),
        }
    }
}

fn table(rows: &[Row]) -> String {
    let head = ["ATE cm", "length error %", "direction %", "impossible", "reversing %", "lost"];
    let figures = |row: &Row| {
        [
            (row.ate_cm, 3),
            (row.length_error_percent, 1),
            (row.direction_percent, 0),
            (row.impossible, 0),
            (row.reversing_percent, 0),
            (row.lost, 0),
        ]
    };
    repeats::table(head, rows.iter().map(|row| (row.name, figures(row))))
}
