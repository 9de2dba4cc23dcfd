//! `report.html`: one file without network access.

use mba_mapper::evaluation::{BlurFigures, TrajectoryFigures};
use mba_mapper::run::{MapFigures, Run, SlamFigures, Spread, Summary, path_of};
use mba_mapper::statistics::Statistics;
use serde_json::Value;

use super::plots::Plot;
use super::table::{map_rows, percent, slam_rows};

pub(super) const STYLE: &str = include_str!("style.css");

/// What follows the title of a page.
pub(super) const TITLE_END: &str = " · mba</title>";

/// Whether a file that begins with `start` is a page as [`page`] makes it.
#[must_use]
pub(super) fn is_own_page(start: &[u8]) -> bool {
    start.starts_with(b"<!doctype html>") && String::from_utf8_lossy(start).contains(TITLE_END)
}

/// The whole page; `pictures` are its sections with pictures.
#[must_use]
pub(super) fn page(run: &Run, plots: &[Plot], pictures: &str) -> String {
    let summary = &run.summary;
    let title = escape(&data_set_name(summary));
    let charts: String =
        plots.iter().map(|plot| format!("<figure>{}</figure>\n", inline(&plot.svg))).collect();
    let tables = [
        frames_table(summary),
        spread_table(summary),
        summary.trajectory.as_ref().map(trajectory_table).unwrap_or_default(),
        summary.blur.as_ref().map(blur_table).unwrap_or_default(),
        summary.map.as_ref().map(map_table).unwrap_or_default(),
        summary.slam.as_ref().map(slam_table).unwrap_or_default(),
        settings_table(summary),
    ];
    format!(
        r#"<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}{TITLE_END}
<style>
{STYLE}</style>
</head>
<body>
<header><h1>{title}</h1><p>{folder}</p></header>
{notices}<section class="tiles">
{tiles}</section>
{pictures}<h2>Charts</h2>
<section class="charts">
{charts}</section>
<h2>Figures</h2>
<section class="tables">
{tables}</section>
<footer>Written by {program}.</footer>
</body>
</html>
"#,
        folder = escape(&path_of(&summary.settings.dataset).display().to_string()),
        notices = notices(summary),
        tiles = tiles(summary),
        tables = tables.concat(),
        program = escape(&summary.settings.program),
    )
}

pub(super) fn data_set_name(summary: &Summary) -> String {
    let path = path_of(&summary.settings.dataset);
    path.file_name().map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().into_owned())
}

/// The SVG without what only a file of its own needs; its size comes from the page.
fn inline(svg: &str) -> String {
    svg.replacen("width=\"580\" height=\"360\" ", "", 1)
}

fn notices(summary: &Summary) -> String {
    let interrupted =
        (!summary.complete).then(|| "The run was interrupted: these are its frames so far.".to_owned());
    let texts = interrupted.iter().chain(&summary.warnings);
    texts.map(|text| format!("<p class=\"notice\">{}</p>\n", escape(text))).collect()
}

/// The figures that matter most, coloured by how good they are.
fn tiles(summary: &Summary) -> String {
    let tracked = summary.frames.tracked_share();
    let mut tiles = vec![tile(&percent(tracked), "frames tracked", grade(tracked, 0.98, 0.9))];
    if let Some(figures) = &summary.trajectory {
        let near = figures.share_within_2cm;
        tiles.push(tile(&format!("{:.2} cm", 100.0 * figures.ate_m.rmse), "trajectory error (RMSE)", ""));
        tiles.push(tile(&percent(near), "of frames within 2 cm", grade(near, 0.95, 0.8)));
    }
    if let Some(psnr) = summary.map.and_then(|map| map.keyframe_psnr) {
        tiles.push(tile(&format!("{psnr:.1} dB"), "deblurred keyframes (PSNR)", ""));
    }
    if let Some(psnr) = summary.map.and_then(|map| map.heldout_psnr) {
        tiles.push(tile(&format!("{psnr:.1} dB"), "new views (PSNR)", ""));
    }
    if let Some(blur) = &summary.blur_px {
        tiles.push(tile(&format!("{:.1} px", blur.mean), "mean blur length", ""));
    }
    if let Some(ms) = &summary.milliseconds {
        let share_of_interval = ms.median * 1e-3 * summary.settings.frame_rate;
        let class = grade(-share_of_interval, -1.0, -2.0);
        tiles.push(tile(&format!("{:.1} ms", ms.median), "per frame (median)", class));
        tiles.push(tile(&format!("{:.1} ms", ms.p99), "per frame (99th percentile)", ""));
    }
    tiles.concat()
}

fn tile(value: &str, label: &str, class: &str) -> String {
    format!("<div class=\"tile {class}\"><b>{value}</b><span>{label}</span></div>\n")
}

fn grade(value: f64, good: f64, doubtful: f64) -> &'static str {
    match value {
        v if v >= good => "good",
        v if v >= doubtful => "doubt",
        _ => "bad",
    }
}

fn frames_table(summary: &Summary) -> String {
    let counts = &summary.frames;
    let rows = [
        ["frames".to_owned(), counts.total.to_string()],
        ["tracked".to_owned(), counts.ok.to_string()],
        ["tracked, doubtful".to_owned(), counts.weak.to_string()],
        ["lost".to_owned(), counts.lost.to_string()],
        ["skipped (unreadable image)".to_owned(), counts.skipped.to_string()],
        ["keyframes".to_owned(), counts.keyframes.to_string()],
        ["deblurred keyframes".to_owned(), summary.deblurred_keyframes.to_string()],
    ];
    card("Frames", &rows)
}

/// Time and blur per frame: where the bulk and where the tail lies.
fn spread_table(summary: &Summary) -> String {
    let row = |(label, spread): (&str, &Spread)| {
        let Spread { mean, median, p95, p99, max } = spread;
        number_row(label, &[mean, median, p95, p99, max].map(|v| format!("{v:.1}")))
    };
    let spreads = [("time [ms]", &summary.milliseconds), ("blur [px]", &summary.blur_px)];
    let rows: String = spreads.into_iter().filter_map(|(l, s)| Some(row((l, s.as_ref()?)))).collect();
    number_table("Per frame", &["mean", "median", "p95", "p99", "max"], &rows, "")
}

fn trajectory_table(figures: &TrajectoryFigures) -> String {
    let row = |label: &str, s: &Statistics, scale: f64| {
        number_row(label, &[s.rmse, s.mean, s.median, s.max].map(|v| format!("{:.3}", scale * v)))
    };
    let rows = [
        row("error [cm]", &figures.ate_m, 100.0),
        row("step error [cm]", &figures.rpe_translation_m, 100.0),
        row("step error [deg]", &figures.rpe_rotation_deg, 1.0),
    ];
    let note = format!("{} poses compared after alignment by rotation and translation.", figures.matches);
    number_table("Trajectory", &["rmse", "mean", "median", "max"], &rows.concat(), &note)
}

fn blur_table(figures: &BlurFigures) -> String {
    let share = |value: Option<f64>| value.map_or_else(|| "no blurred frame".to_owned(), percent);
    let rows = [
        ["true blur, mean".to_owned(), format!("{:.2} px", figures.mean_reference_px)],
        ["estimated blur, mean".to_owned(), format!("{:.2} px", figures.mean_estimate_px)],
        ["frames with more than 5 px".to_owned(), figures.blurred_frames.to_string()],
        ["median error of their blur length".to_owned(), share(figures.median_relative_error)],
        ["right direction of time".to_owned(), share(figures.direction_share)],
    ];
    card("Motion within the exposure", &rows)
}

fn map_table(figures: &MapFigures) -> String {
    labelled_card("Map", map_rows(figures))
}

fn slam_table(figures: &SlamFigures) -> String {
    labelled_card("Tracking and mapping", slam_rows(figures))
}

fn labelled_card(title: &str, rows: Vec<(&'static str, String)>) -> String {
    let rows: Vec<[String; 2]> =
        rows.into_iter().map(|(label, value)| [label.trim().to_owned(), value]).collect();
    card(title, &rows)
}

fn settings_table(summary: &Summary) -> String {
    let mut rows = vec![["frame rate".to_owned(), format!("{} per second", summary.settings.frame_rate)]];
    for (name, value) in &summary.settings.options {
        let text = match value {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        rows.push([name.replace('_', " "), text]);
    }
    card("Settings", &rows)
}

fn number_row(label: &str, numbers: &[String]) -> String {
    let cells: String = numbers.iter().map(|n| format!("<td class=\"number\">{n}</td>")).collect();
    format!("<tr><th>{label}</th>{cells}</tr>\n")
}

fn number_table(title: &str, columns: &[&str], rows: &str, note: &str) -> String {
    let head: String = columns.iter().map(|c| format!("<th class=\"number\">{c}</th>")).collect();
    format!(
        "<div class=\"card\"><h2>{title}</h2><table><thead><tr><th></th>{head}</tr></thead><tbody>\n\
         {rows}</tbody></table><p>{note}</p></div>\n"
    )
}

fn card(title: &str, rows: &[[String; 2]]) -> String {
    let row = |[label, value]: &[String; 2]| {
        format!("<tr><th>{}</th><td class=\"number\">{}</td></tr>\n", escape(label), escape(value))
    };
    let body: String = rows.iter().map(row).collect();
    format!("<div class=\"card\"><h2>{title}</h2><table><tbody>\n{body}</tbody></table></div>\n")
}

/// Text that is safe between and inside tags.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_inject_markup() {
        assert_eq!(escape("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
    }

    #[test]
    fn grades_have_inclusive_borders() {
        assert_eq!(
            [grade(0.98, 0.98, 0.9), grade(0.9, 0.98, 0.9), grade(f64::NAN, 0.9, 0.8)],
            ["good", "doubt", "bad"]
        );
    }
}
