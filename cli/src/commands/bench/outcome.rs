//! What the runs of a benchmark came to.

use mba_mapper::run::Summary;
use serde::Serialize;

use super::benchmark::Benchmark;
use crate::commands::repeats::{Spread, spread};

/// The benchmark with what was measured.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Outcome {
    pub(super) benchmark: Benchmark,
    /// Of the sequences that could be run.
    pub(super) measured: Vec<Measured>,
    /// Names of those that could not.
    pub(super) failed: Vec<String>,
}

/// Figures of one sequence; of each the middle, the least and the most of the runs, none where a run has none.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Measured {
    pub(super) sequence: String,
    pub(super) runs: usize,
    pub(super) ate_cm: Spread,
    /// Of deblurred keyframes against the data set's sharp images.
    pub(super) psnr_db: Spread,
    pub(super) ssim: Spread,
    pub(super) tracked_percent: Spread,
    /// Of the tracker alone, or of tracking and mapping together.
    pub(super) frames_per_second: Spread,
}

impl Measured {
    pub(super) fn new(sequence: &str, summaries: &[Summary]) -> Self {
        let of = |figure| spread(summaries, figure);
        Self {
            sequence: sequence.to_owned(),
            runs: summaries.len(),
            ate_cm: of(|summary| Some(100.0 * summary.trajectory.as_ref()?.ate_m.rmse)),
            psnr_db: of(|summary| summary.map?.keyframe_psnr),
            ssim: of(|summary| summary.map?.keyframe_ssim),
            tracked_percent: of(|summary| Some(100.0 * summary.frames.tracked_share())),
            frames_per_second: of(|summary| match summary.slam {
                Some(slam) => Some(slam.frames_per_second),
                None => Some(1e3 / summary.milliseconds?.mean),
            }),
        }
    }
}
