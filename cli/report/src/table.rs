//! Tables for the terminal.

use std::fmt::Write as _;

use mba_mapper::evaluation::{BlurFigures, MotionPlausibility, TrajectoryFigures};
use mba_mapper::run::{LocalisationFigures, MapFigures, SlamFigures, Spread, Summary, UpSource, Upright};
use mba_mapper::statistics::Statistics;

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
        ("drift at the end", format!("{:.6} m, {:.4} deg", figures.end_drift_m, figures.end_drift_deg)),
    ];
    text + &pairs(&rows) + &scale_row(figures.scale)
}

/// How many motions within exposures cannot be, or are unlikely.
#[must_use]
pub fn plausible(found: &MotionPlausibility) -> String {
    let MotionPlausibility { judged, impossible, pairs, reversing } = found;
    format!("{impossible} of {judged} impossible, {reversing} of {pairs} blurred neighbours reversed")
}

/// What is known of the world's z axis.
#[must_use]
pub fn upright(how: &Upright) -> String {
    let sigma = how.sigma_degrees.map_or_else(String::new, |sigma| format!(" +- {sigma:.1} degrees"));
    match how.source {
        UpSource::Accelerometer => format!("z is up{sigma}, by the accelerometer"),
        UpSource::Given => "z is up, as given".to_owned(),
    }
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
    rows.extend(summary.plausibility.iter().map(|found| ("exposure motions", plausible(found))));
    rows.extend(summary.upright.iter().map(|how| ("world", upright(how))));
    let mut text = pairs(&rows);
    let parts = [
        summary.trajectory.as_ref().map(trajectory),
        summary.blur.as_ref().map(blur),
        summary.map.as_ref().map(map),
        summary.slam.as_ref().map(|figures| pairs(&slam_rows(figures))),
        summary.localisation.as_ref().map(localisation),
    ];
    for part in parts {
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

/// The table of a map.
#[must_use]
pub fn map(figures: &MapFigures) -> String {
    pairs(&map_rows(figures))
}

/// Label and value of everything that is known of a map.
#[must_use]
pub fn map_rows(figures: &MapFigures) -> Vec<(&'static str, String)> {
    let MapFigures { gaussians, iterations, seconds, peak_memory_bytes, loss, keyframes, .. } = figures;
    let mut rows = Vec::new();
    if *gaussians > 0 {
        rows.push(("Gaussians", gaussians.to_string()));
    }
    if figures.map_file_bytes > 0 {
        rows.push(("map file", format!("{:.1} MB", figures.map_file_bytes as f64 / 1e6)));
    }
    rows.extend([
        ("keyframes in the map", keyframes.to_string()),
        ("iterations", format!("{iterations} in {seconds:.0} s")),
        ("loss at the end", format!("{loss:.5}")),
    ]);
    if *peak_memory_bytes > 0 {
        rows.push(("peak memory", format!("{:.0} MB", *peak_memory_bytes as f64 / 1e6)));
    }
    let captured = figures.keyframe_psnr_captured.map(|db| format!("{db:.2} dB"));
    rows.extend(captured.map(|text| ("keyframes as captured", text)));
    let likeness = [
        ("keyframes deblurred", figures.keyframe_psnr, figures.keyframe_ssim),
        ("views held out", figures.heldout_psnr, figures.heldout_ssim),
    ];
    let mapped = figures.heldout_psnr_mapped.zip(figures.heldout_mapped_share);
    let where_mapped = |(db, share)| format!("{db:.2} dB over {} of the pixels", percent(share));
    for (label, psnr, ssim) in likeness {
        let parts = [psnr.map(|db| format!("{db:.2} dB")), ssim.map(|ssim| format!("SSIM {ssim:.4}"))];
        let text = parts.into_iter().flatten().collect::<Vec<_>>().join(", ");
        rows.extend((!text.is_empty()).then_some((label, text)));
    }
    rows.extend(mapped.map(|mapped| ("  where there is a map", where_mapped(mapped))));
    let predicted = |db| format!("{db:.2} dB, {} that are no keyframes", figures.predicted_frames);
    rows.extend(figures.predicted_psnr.map(|db| ("frames predicted", predicted(db))));
    rows
}

/// Label and value of how tracking and mapping at the same time went.
#[must_use]
pub fn slam_rows(figures: &SlamFigures) -> Vec<(&'static str, String)> {
    let mut rows = vec![
        ("frames per second", format!("{:.2} with the refinement", figures.frames_per_second)),
        ("  until the last frame", format!("{:.2}", figures.live_frames_per_second)),
        ("frames on the map", figures.frames_on_map.to_string()),
        ("loops closed", figures.loops.to_string()),
        ("relocalisations", figures.relocalisations.to_string()),
    ];
    rows.extend(figures.tracked_ate_m.map(|ate| ("ATE as tracked", format!("{ate:.6} m"))));
    let counts =
        [("frames too late", figures.late_frames), ("keyframes given up", figures.retired_keyframes)];
    rows.extend(counts.iter().filter(|(_, n)| *n > 0).map(|(label, n)| (*label, n.to_string())));
    rows
}

/// How finding a recording in a map went.
fn localisation(figures: &LocalisationFigures) -> String {
    let LocalisationFigures { places, frames_on_map, recognised, recovered } = figures;
    pairs(&[
        ("places in the map", places.to_string()),
        ("frames on the map", frames_on_map.to_string()),
        ("times recognised", recognised.to_string()),
        ("found afterwards", recovered.to_string()),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_of_a_map_is_left_out() {
        let figures = MapFigures { gaussians: 50_000, iterations: 900, seconds: 61.4, ..Default::default() };
        let text = map(&figures);
        assert!(text.contains("50000") && text.contains("900 in 61 s"), "{text}");
        assert!(!text.contains("dB") && !text.contains("memory"), "{text}");
        let with_truth = MapFigures {
            peak_memory_bytes: 1_234_000_000,
            keyframe_psnr_captured: Some(24.0),
            keyframe_psnr: Some(30.126),
            keyframe_ssim: Some(0.91),
            heldout_ssim: Some(0.875),
            predicted_frames: 36,
            predicted_psnr: Some(29.731),
            ..figures
        };
        let lines = map(&with_truth);
        for line in [
            "peak memory             1234 MB\n",
            "keyframes as captured   24.00 dB\n",
            "keyframes deblurred     30.13 dB, SSIM 0.9100\n",
            "views held out          SSIM 0.8750\n",
            "frames predicted        29.73 dB, 36 that are no keyframes\n",
        ] {
            assert!(lines.contains(line), "{lines}");
        }
    }
}
