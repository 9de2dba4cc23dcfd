//! What the parts of SLAM are worth.

use mba_mapper::dataset::Dataset;
use mba_mapper::run::Summary;
use serde::Serialize;

use super::super::repeats::{self, Repeats, Spread, nudged, spread};
use super::super::slam;
use crate::args::slam::{Ablation, MapReference, Slamming};
use crate::args::{BlurMode, Switch};
use crate::console::Console;
use crate::interrupt::Resumption;

/// Virtual views of the row that has few.
const FEW_VIEWS: usize = 3;

/// One row of the table; of each figure the middle, the least and the most of the runs.
#[derive(Clone, Debug, Serialize)]
struct Row {
    name: &'static str,
    runs: usize,
    ate_cm: Spread,
    tracked_ate_cm: Spread,
    end_drift_cm: Spread,
    deblurred_psnr: Spread,
    heldout_psnr: Spread,
    frames_per_second: Spread,
    lost: Spread,
}

/// Runs SLAM with each part left out in turn and prints a table.
///
/// # Errors
/// As `mba slam`.
pub(super) fn run(dataset: &Dataset, repeats: Repeats<'_>, console: &Console) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for (name, ablation) in variants() {
        let summaries = repeats::summaries(repeats, name, console, |repeat, out| {
            let slamming = Slamming { ablation, ..Slamming::default() };
            let dataset = nudged(dataset, repeat)?;
            slam::slam_into(&dataset, out, (false, Resumption::Always), &slamming, console)
        })?;
        rows.push(Row::new(name, &summaries));
    }
    console.result(&rows, |rows| table(rows))
}

/// What is left out or replaced, by the name of its row.
fn variants() -> [(&'static str, Ablation); 8] {
    let all = Ablation::default();
    [
        ("everything", all),
        ("blur off", Ablation { blur: BlurMode::Off, ..all }),
        ("three views", Ablation { virtual_views: Some(FEW_VIEWS), ..all }),
        ("reference raw", Ablation { reference: MapReference::Raw, ..all }),
        ("reference deblurred", Ablation { reference: MapReference::Deblurred, ..all }),
        ("depth term off", Ablation { depth_term: Switch::Off, ..all }),
        ("loop off", Ablation { loops: Switch::Off, ..all }),
        ("continuity off", Ablation { no_continuity: true, ..all }),
    ]
}

impl Row {
    fn new(name: &'static str, summaries: &[Summary]) -> Self {
        let of = |figure| spread(summaries, figure);
        Self {
            name,
            runs: summaries.len(),
            ate_cm: of(|summary| Some(100.0 * summary.trajectory.as_ref()?.ate_m.rmse)),
            tracked_ate_cm: of(|summary| Some(100.0 * summary.slam?.tracked_ate_m?)),
            end_drift_cm: of(|summary| Some(100.0 * summary.trajectory.as_ref()?.end_drift_m)),
            deblurred_psnr: of(|summary| summary.map?.keyframe_psnr),
            heldout_psnr: of(|summary| summary.map?.heldout_psnr),
            frames_per_second: of(|summary| Some(summary.slam?.frames_per_second)),
            lost: of(|summary| Some(summary.frames.lost as f64)),
        }
    }
}

fn table(rows: &[Row]) -> String {
    let head = ["ATE cm", "as tracked", "end drift", "deblurred dB", "held out dB", "frames/s", "lost"];
    let figures = |row: &Row| {
        [
            (row.ate_cm, 3),
            (row.tracked_ate_cm, 3),
            (row.end_drift_cm, 3),
            (row.deblurred_psnr, 2),
            (row.heldout_psnr, 2),
            (row.frames_per_second, 2),
            (row.lost, 0),
        ]
    };
    repeats::table(head, rows.iter().map(|row| (row.name, figures(row))))
}
