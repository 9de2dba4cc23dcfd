//! Tables for the terminal.

use std::fmt::Write as _;

use mba_mapper::evaluation::{BlurFigures, Statistics, TrajectoryFigures};
use mba_mapper::run::{Spread, Summary};

/// The table of a trajectory evaluation, lengths in metres, angles in degrees.
#[must_use]
pub fn trajectory(figures: &TrajectoryFigures) -> String {
    let mut text = format!(
        "{:24}{:>12}{:>12}{:>12}{:>12}{:>12}{:>12}\n",
        "", "rmse", "mean", "median", "std", "min", "max"
    );
    for (label, s) in [
        ("ATE [m]", &figures.ate_m),
        ("RPE per frame [m]", &figures.rpe_translation_m),
        ("RPE per frame [deg]", &figures.rpe_rotation_deg),
    ] {
        let Statistics { rmse, mean, median, std, min, max } = s;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{label:24}{rmse:>12.6}{mean:>12.6}{median:>12.6}{std:>12.6}{min:>12.6}{max:>12.6}"
        );
    }
    let rows = [
        ("matched poses", figures.matches.to_string()),
        ("of the estimate", percent(figures.estimate_coverage)),
        ("of the reference", percent(figures.reference_coverage)),
        ("within 2 cm", percent(figures.share_within_2cm)),
    ];
    text + &pairs(&rows) + &scale_row(figures.scale)
}

/// The table of a run: counts, times and, with ground truth, figures of merit.
#[must_use]
pub fn summary(summary: &Summary) -> String {
    let counts = &summary.frames;
    let doubt = [("weak", counts.weak), ("lost", counts.lost), ("skipped", counts.skipped)];
    let doubt: String = doubt.iter().map(|(name, n)| format!(", {n} {name}")).collect();
    let tracked = format!("{} of {}{doubt}", percent(counts.tracked_share()), counts.total);
    let keyframes = format!("{}, {} deblurred", counts.keyframes, summary.deblurred_keyframes);
    let mut rows = vec![("tracked", tracked), ("keyframes", keyframes)];
    let spread = |s: &Spread, unit: &str| {
        format!("median {:.2}, p95 {:.2}, p99 {:.2}, max {:.2} {unit}", s.median, s.p95, s.p99, s.max)
    };
    rows.extend(summary.milliseconds.iter().map(|s| ("time per frame", spread(s, "ms"))));
    rows.extend(summary.blur_px.iter().map(|s| ("estimated blur", spread(s, "px"))));
    let mut text = pairs(&rows);
    for part in [summary.trajectory.as_ref().map(trajectory), summary.blur.as_ref().map(blur)] {
        text.extend(part.map(|part| "\n".to_owned() + &part));
    }
    text
}

/// The table of the blur figures.
#[must_use]
pub fn blur(figures: &BlurFigures) -> String {
    let or_none = |share: Option<f64>| share.map_or_else(|| "no blurred frame".to_owned(), percent);
    pairs(&[
        ("compared exposures", figures.frames.to_string()),
        ("true blur, mean", format!("{:.2} px", figures.mean_reference_px)),
        ("estimated blur, mean", format!("{:.2} px", figures.mean_estimate_px)),
        ("frames over 5 px", figures.blurred_frames.to_string()),
        ("  median length error", or_none(figures.median_relative_error)),
        ("  time direction right", or_none(figures.direction_share)),
    ])
}

/// Lines of label and value.
#[must_use]
pub fn pairs(rows: &[(&str, String)]) -> String {
    rows.iter().map(|(label, value)| format!("{label:24}{value}\n")).collect()
}

/// A share (0 to 1) for reading.
#[must_use]
pub fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn scale_row(scale: f64) -> String {
    if scale == 1.0 { String::new() } else { pairs(&[("scale of the estimate", format!("{scale:.6}"))]) }
}
