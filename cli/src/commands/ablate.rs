//! `mba ablate`.

use mba_mapper::run::{Run, Summary};
use serde::Serialize;

use super::{calibrate, open, slam};
use crate::args::slam::{Ablate, Ablation, MapReference, Slamming};
use crate::args::{BlurMode, Switch};
use crate::console::Console;
use crate::interrupt::Resumption;

/// Virtual views of the row that has few.
const FEW_VIEWS: usize = 3;

/// One row of the table.
#[derive(Clone, Debug, Serialize)]
struct Row {
    name: &'static str,
    ate_cm: Option<f64>,
    tracked_ate_cm: Option<f64>,
    end_drift_cm: Option<f64>,
    deblurred_psnr: Option<f64>,
    heldout_psnr: Option<f64>,
    frames_per_second: Option<f64>,
    lost: usize,
}

/// Runs SLAM with each part left out in turn and prints a table.
///
/// # Errors
/// As `mba slam`.
pub fn run(args: &Ablate, console: &Console) -> anyhow::Result<()> {
    let dataset = calibrate::completed(open::dataset(&args.dataset)?, Switch::On, console)?;
    let mut rows = Vec::new();
    for (name, ablation) in variants() {
        let out = args.out.join(name.replace(' ', "-"));
        let finished = Run::open(&out).ok().map(|run| run.summary).filter(|summary| summary.complete);
        let summary = match finished {
            Some(summary) => summary,
            None => {
                console.note(format!("{name}:"));
                let slamming = Slamming { ablation, ..Slamming::default() };
                slam::slam_into(&dataset, &out, (false, Resumption::Always), &slamming, console)?
            }
        };
        rows.push(Row::new(name, &summary));
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
    fn new(name: &'static str, summary: &Summary) -> Self {
        let (trajectory, map, slam) =
            (summary.trajectory.as_ref(), summary.map.as_ref(), summary.slam.as_ref());
        Self {
            name,
            ate_cm: trajectory.map(|figures| 100.0 * figures.ate_m.rmse),
            tracked_ate_cm: slam.and_then(|figures| figures.tracked_ate_m).map(|ate| 100.0 * ate),
            end_drift_cm: trajectory.map(|figures| 100.0 * figures.end_drift_m),
            deblurred_psnr: map.and_then(|figures| figures.keyframe_psnr),
            heldout_psnr: map.and_then(|figures| figures.heldout_psnr),
            frames_per_second: slam.map(|figures| figures.frames_per_second),
            lost: summary.frames.lost,
        }
    }
}

fn table(rows: &[Row]) -> String {
    let head = ["ATE cm", "as tracked", "end drift", "deblurred dB", "held out dB", "frames/s", "lost"];
    let mut text = format!("{:22}", "") + &head.map(|name| format!("{name:>14}")).concat() + "\n";
    for row in rows {
        let number = |value: Option<f64>, digits: usize| {
            let text = value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"));
            format!("{text:>14}")
        };
        let cells = [
            number(row.ate_cm, 3),
            number(row.tracked_ate_cm, 3),
            number(row.end_drift_cm, 3),
            number(row.deblurred_psnr, 2),
            number(row.heldout_psnr, 2),
            number(row.frames_per_second, 2),
            format!("{:>14}", row.lost),
        ];
        text += &format!("{:22}{}\n", row.name, cells.concat());
    }
    text
}
