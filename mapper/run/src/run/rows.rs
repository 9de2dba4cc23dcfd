//! What a run has recorded, as a checkpoint keeps it.

use mba_io::checkpoint::exact_poses::{PoseNumbers, numbers, pose};
use mba_io::trajectory_file::TimedExposure;
use serde::{Deserialize, Serialize};

use super::{FrameRecord, RunError, RunWriter, TrackRecord, Upright};

/// A [`TrackRecord`] as it is stored.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RunRows {
    /// Time and poses at opening, middle and closing of the shutter.
    exposures: Vec<(f64, [PoseNumbers; 3])>,
    frames: Vec<FrameRecord>,
    skipped: usize,
    upright: Option<Upright>,
    warnings: Vec<String>,
}

impl RunRows {
    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Whether these can be rows of a data set of `frames` frames.
    #[must_use]
    pub fn is_of(&self, frames: usize) -> bool {
        let rows = self.len();
        rows <= frames && self.exposures.len() == rows && self.skipped <= rows
    }
}

impl TrackRecord {
    /// What was recorded so far.
    #[must_use]
    pub fn rows(&self) -> RunRows {
        let row = |exposure: &TimedExposure| {
            (exposure.timestamp, [exposure.start, exposure.mid, exposure.end].map(|pose| numbers(&pose)))
        };
        RunRows {
            exposures: self.exposures.iter().map(row).collect(),
            frames: self.frames.clone(),
            skipped: self.skipped,
            upright: self.upright,
            warnings: self.warnings.clone(),
        }
    }

    /// Takes over what a run that was stopped had recorded.
    pub(super) fn restore(&mut self, rows: RunRows) {
        let exposure = |(timestamp, poses): (f64, [PoseNumbers; 3])| {
            let [start, mid, end] = poses.map(pose);
            TimedExposure { timestamp, start, mid, end }
        };
        self.exposures = rows.exposures.into_iter().map(exposure).collect();
        self.frames = rows.frames;
        self.skipped = rows.skipped;
        self.upright = rows.upright;
        self.warnings = rows.warnings;
    }
}

impl RunWriter {
    /// As [`Self::restore`], in the folder of that very run: images that lie there are its own and stay.
    ///
    /// # Errors
    /// As [`Self::flush`].
    pub fn go_on(&mut self, rows: RunRows) -> Result<(), RunError> {
        self.is_started = true;
        self.restore(rows)
    }

    /// Takes over what a run that was stopped had recorded, and brings the folder up to date.
    ///
    /// # Errors
    /// As [`Self::flush`].
    pub fn restore(&mut self, rows: RunRows) -> Result<(), RunError> {
        self.record.restore(rows);
        self.flush()
    }
}
