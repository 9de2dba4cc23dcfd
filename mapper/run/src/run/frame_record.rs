//! One row of `frames.csv`.

use std::path::Path;

use mba_io::whole_file::read_text;
use mba_tracker::FrameStatus;
use serde::{Deserialize, Serialize};

use super::RunError;

/// The tracker's status as it is written.
#[derive(Serialize, Deserialize)]
#[serde(remote = "FrameStatus", rename_all = "lowercase")]
enum StoredStatus {
    Ok,
    Weak,
    Lost,
}

/// What is recorded of one frame besides its poses. Values that do not exist, such as the residual of a lost frame,
/// are NaN.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Mid exposure, seconds.
    pub timestamp: f64,
    /// How far the pose can be trusted.
    #[serde(with = "StoredStatus")]
    pub status: FrameStatus,
    /// 1 if this frame became a keyframe, else 0.
    pub keyframe: u8,
    /// Time to track the frame in milliseconds, without reading it.
    pub ms: f64,
    /// Estimated blur length in pixels.
    pub blur_px: f64,
    /// Virtual views over the exposure at the finest level.
    pub virtual_views: u32,
    /// Solver iterations over all levels.
    pub iterations: u32,
    /// Robust photometric residual, in standard deviations of the nominal noise.
    pub residual: f64,
    /// Share (0 to 1) of the patches that are inliers.
    pub inliers: f64,
    /// Brightness factor against the keyframe.
    pub gain: f64,
    /// Standard deviation of the position at mid exposure relative to the first frame, all axes together, metres; none
    /// where it was not tracked, and in runs of versions that did not say it.
    #[serde(default)]
    pub sigma_m: Option<f64>,
    /// Why the frame is weak or lost; none for one that is ok, and in runs of versions that did not say it.
    #[serde(default)]
    pub reason: Option<Reason>,
}

impl FrameRecord {
    /// A frame of a status of which nothing else is known: figures that do not exist are NaN, counts and shares are 0.
    #[must_use]
    pub fn without_figures(timestamp: f64, status: FrameStatus) -> Self {
        Self {
            timestamp,
            status,
            keyframe: 0,
            ms: f64::NAN,
            blur_px: f64::NAN,
            virtual_views: 0,
            iterations: 0,
            residual: f64::NAN,
            inliers: 0.0,
            gain: f64::NAN,
            sigma_m: None,
            reason: None,
        }
    }
}

/// Why a frame is weak or lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reason {
    /// The image shows nothing: it is black, saturated or covered.
    Blind,
    /// Nothing to start from: too little depth, depth out of any sensor's range, or no texture.
    #[serde(rename = "no start")]
    NoStart,
    /// Nothing of the reference was found.
    #[serde(rename = "no match")]
    NoMatch,
    /// The camera would have moved faster than any hand.
    Speed,
    /// The brightness would have changed more than any exposure control changes it.
    Brightness,
    /// Few of the reference's patches are in view and agree.
    Inliers,
    /// Picture and depth fit much worse than usual.
    Residual,
    /// Found again near an earlier keyframe; the motion is not known yet.
    #[serde(rename = "found again")]
    FoundAgain,
    /// The frame could not be read or used.
    Skipped,
}

impl Reason {
    /// The reason as in the table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Blind => "blind",
            Self::NoStart => "no start",
            Self::NoMatch => "no match",
            Self::Speed => "speed",
            Self::Brightness => "brightness",
            Self::Inliers => "inliers",
            Self::Residual => "residual",
            Self::FoundAgain => "found again",
            Self::Skipped => "skipped",
        }
    }
}

/// The header of the table.
const COLUMNS: [&str; 12] = [
    "timestamp",
    "status",
    "keyframe",
    "ms",
    "blur_px",
    "virtual_views",
    "iterations",
    "residual",
    "inliers",
    "gain",
    "sigma_m",
    "reason",
];

/// The table as text.
pub(super) fn format_frames(frames: &[FrameRecord]) -> String {
    let mut text = COLUMNS.join(",");
    text.push('\n');
    for f in frames {
        let status = f.status.name();
        text.push_str(&format!(
            "{:.6},{status},{},{:.3},{:.3},{},{},{:.6},{:.4},{:.4},{},{}\n",
            f.timestamp,
            f.keyframe,
            f.ms,
            f.blur_px,
            f.virtual_views,
            f.iterations,
            f.residual,
            f.inliers,
            f.gain,
            f.sigma_m.map_or(String::new(), |sigma| format!("{sigma:.6}")),
            f.reason.map_or("", Reason::name)
        ));
    }
    text
}

/// Reads the table; columns are found by name.
pub(super) fn read_frames(path: &Path) -> Result<Vec<FrameRecord>, RunError> {
    let text = read_text(path)?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    reader.deserialize().map(|row| row.map_err(|error| malformed(path, &error))).collect()
}

fn malformed(path: &Path, error: &csv::Error) -> RunError {
    // What the reader has no place for is wrong in the first line: a column is missing.
    let line = error.position().map_or(1, csv::Position::line);
    let message = match error.kind() {
        csv::ErrorKind::Deserialize { err, .. } => match err.field().and_then(|f| COLUMNS.get(f as usize)) {
            Some(column) => format!("column {column}: {}", err.kind()),
            None => err.kind().to_string(),
        },
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} values, expected {expected_len}")
        }
        _ => error.to_string(),
    };
    RunError::MalformedFrame { path: path.to_owned(), line, message }
}
