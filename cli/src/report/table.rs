//! Tables for the terminal.

use std::fmt::Write as _;

use mba_mapper::evaluation::{BlurFigures, Statistics, TrajectoryFigures};

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
