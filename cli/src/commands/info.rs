//! `mba info`.

use std::path::Path;

use mba_mapper::dataset::{Dataset, Survey, survey};
use mba_mapper::evaluation::associate;
use mba_mapper::self_calibration::{depth_lag, quick_contradictions};
use mba_tracker::SimdLevel;
use serde::Serialize;

use super::camera_facts::CameraFacts;
use super::{open, outcome};
use crate::args::Info;
use crate::console::Console;
use crate::failure::{bad_input, failed};
use crate::report::table::{pairs, percent};

/// Frames whose images are read.
const SAMPLED_FRAMES: usize = 16;

/// Median depths in metres that a depth camera can have seen.
const PLAUSIBLE_DEPTH: std::ops::RangeInclusive<f64> = 0.1..=30.0;

/// What is printed.
#[derive(Serialize)]
struct Facts {
    name: String,
    folder: String,
    frames: usize,
    first_timestamp: f64,
    duration_s: f64,
    measured_rate_hz: Option<f64>,
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    distortion: [f64; 5],
    depth_scale: f64,
    #[serde(flatten)]
    camera: CameraFacts,
    sampled_frames: usize,
    unreadable_frames: usize,
    frames_without_depth: usize,
    frames_with_swapped_depth: usize,
    missing_depth_share: Option<f64>,
    median_depth_m: Option<f64>,
    ground_truth_poses: usize,
    ground_truth_share_of_frames: f64,
    ground_truth_exposures: usize,
    warnings: Vec<String>,
}

/// Opens a data set, looks at some of its frames and prints what is there.
///
/// # Errors
/// Bad input when the data set cannot be used, or when no frame of it can be read; a failure when its images hold nothing
/// that could be tracked. What was found out is printed before.
pub fn run(args: &Info, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let dataset = open::dataset(&args.dataset, simd)?;
    let survey = survey(&dataset, SAMPLED_FRAMES);
    let (unreadable, sampled) = (survey.unreadable.len(), survey.sampled);
    let first = survey.unreadable.first().cloned().unwrap_or_default();
    let missing = outcome::what_is_missing(&survey);
    console.result(&Facts::of(&dataset, survey), table)?;
    if unreadable == sampled {
        let message = format!("none of {sampled} sampled frames can be read, the first because {first}");
        return Err(bad_input(message, "correct the lists, or restore the images"));
    }
    match missing {
        Some(missing) => Err(failed(
            format!("nothing here can be tracked: {missing}"),
            "restore or convert these images, or record again with light and with depth",
        )),
        None => Ok(()),
    }
}

impl Facts {
    fn of(dataset: &Dataset, survey: Survey) -> Self {
        let stamps: Vec<f64> = (0..dataset.len()).map(|k| dataset.timestamp(k)).collect();
        let duration_s = stamps.last().zip(stamps.first()).map_or(0.0, |(last, first)| last - first);
        let calibration = dataset.calibration();
        let facts = CameraFacts::of(dataset);
        let (camera, lens) = (calibration.camera, calibration.distortion);
        Self {
            name: dataset.name().to_owned(),
            folder: dataset.folder().display().to_string(),
            frames: dataset.len(),
            first_timestamp: stamps.first().copied().unwrap_or_default(),
            duration_s,
            measured_rate_hz: (duration_s > 0.0).then(|| (dataset.len() - 1) as f64 / duration_s),
            width: camera.width,
            height: camera.height,
            fx: camera.fx,
            fy: camera.fy,
            cx: camera.cx,
            cy: camera.cy,
            distortion: [lens.k1, lens.k2, lens.p1, lens.p2, lens.k3],
            depth_scale: calibration.depth_scale,
            sampled_frames: survey.sampled,
            unreadable_frames: survey.unreadable.len(),
            frames_without_depth: survey.without_depth,
            frames_with_swapped_depth: survey.swapped_depth,
            missing_depth_share: survey.missing_depth,
            median_depth_m: survey.median_depth,
            ground_truth_poses: dataset.ground_truth().len(),
            ground_truth_share_of_frames: truth_share(dataset, &stamps),
            ground_truth_exposures: dataset.ground_truth_exposures().len(),
            warnings: warnings(dataset, &facts, survey),
            camera: facts,
        }
    }
}

/// Share of the frames whose mid exposure lies within a frame interval of a true pose.
fn truth_share(dataset: &Dataset, stamps: &[f64]) -> f64 {
    let truth: Vec<f64> = dataset.ground_truth().iter().map(|pose| pose.timestamp).collect();
    let interval = 1.0 / dataset.calibration().frame_rate;
    associate(&truth, stamps, 0.5 * interval).len() as f64 / stamps.len().max(1) as f64
}

fn warnings(dataset: &Dataset, camera: &CameraFacts, survey: Survey) -> Vec<String> {
    let mut warnings: Vec<String> = dataset.warnings().iter().map(ToString::to_string).collect();
    warnings.extend(camera.contradictions(dataset));
    warnings.extend(grouped(survey.unreadable, dataset.folder()));
    if let Some(median) = survey.median_depth.filter(|median| !PLAUSIBLE_DEPTH.contains(median)) {
        warnings.push(format!("the median depth is {median} m: is depth_scale in raw units per metre?"));
    }
    warnings.extend(depth_lag(dataset).map(|lag| lag.to_string()));
    warnings.extend(quick_contradictions(dataset).iter().map(ToString::to_string));
    if survey.black > 0 {
        warnings.push(format!("{} of {} sampled colour images are black", survey.black, survey.sampled));
    } else if survey.plain > 0 {
        let (plain, sampled) = (survey.plain, survey.sampled);
        warnings.push(format!("{plain} of {sampled} sampled colour images show nothing, all of one colour"));
    }
    if survey.without_depth > 0 {
        let (empty, sampled) = (survey.without_depth, survey.sampled);
        warnings.push(format!("{empty} of {sampled} sampled depth images hold no depth at all"));
    }
    if survey.swapped_depth > 0 {
        warnings.push(outcome::swapped(survey.swapped_depth, survey.sampled));
    }
    warnings
}

/// Sentences that differ in the name of a file of `folder` only, once with their number.
fn grouped(sentences: Vec<String>, folder: &Path) -> Vec<String> {
    let folder = folder.display().to_string();
    // What is left of a sentence without the words that are paths in the data set.
    let gist = |sentence: &str| -> String {
        sentence.split(' ').filter(|word| !word.starts_with(&folder)).collect::<Vec<_>>().join(" ")
    };
    let mut groups: Vec<(String, usize, String)> = Vec::new();
    for sentence in sentences {
        let gist = gist(&sentence);
        match groups.iter_mut().find(|(known, ..)| *known == gist) {
            Some((_, count, _)) => *count += 1,
            None => groups.push((gist, 1, sentence)),
        }
    }
    let more = |count| match count {
        0 => String::new(),
        1 => " (and 1 more like this)".to_owned(),
        more => format!(" (and {more} more like this)"),
    };
    groups.into_iter().map(|(_, count, first)| first + &more(count - 1)).collect()
}

fn table(facts: &Facts) -> String {
    let rate = facts.measured_rate_hz.map_or(String::new(), |hz| format!(", {hz:.2} frames per second"));
    let missing = facts.missing_depth_share.map_or_else(|| "unknown".into(), percent);
    let depth = facts.median_depth_m.map_or_else(|| "none".into(), |m| format!("{m:.2} m"));
    let truth = match facts.ground_truth_poses {
        0 => "none".to_owned(),
        n => format!("{n} poses, near {} of the frames", percent(facts.ground_truth_share_of_frames)),
    };
    let mut rows = vec![
        ("data set", facts.name.clone()),
        ("frames", format!("{} in {:.2} s{rate}", facts.frames, facts.duration_s)),
        ("image size", format!("{} x {}", facts.width, facts.height)),
        ("focal length", format!("{:.2} {:.2} px", facts.fx, facts.fy)),
        ("principal point", format!("{:.2} {:.2} px", facts.cx, facts.cy)),
        ("distortion", distortion(&facts.distortion)),
    ];
    rows.extend(facts.camera.rows());
    rows.extend([
        ("depth scale", format!("{} per metre", facts.depth_scale)),
        ("median depth", depth),
        ("missing depth", format!("{missing} of {} sampled frames", facts.sampled_frames)),
        ("ground truth", truth),
        ("true exposures", facts.ground_truth_exposures.to_string()),
    ]);
    rows.extend(facts.warnings.iter().map(|warning| ("warning", warning.clone())));
    pairs(&rows)
}

fn distortion(coefficients: &[f64; 5]) -> String {
    if coefficients.iter().all(|k| *k == 0.0) {
        return "none".to_owned();
    }
    let [k1, k2, p1, p2, k3] = coefficients;
    format!("k1 {k1} k2 {k2} p1 {p1} p2 {p2} k3 {k3}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn like_sentences_are_counted() {
        let sentences = ["/data/rgb/1.png is cut", "/data/rgb/2.png is cut", "/data/rgb/3.png is green"];
        let grouped = grouped(sentences.map(str::to_owned).into(), Path::new("/data"));
        assert_eq!(grouped, ["/data/rgb/1.png is cut (and 1 more like this)", "/data/rgb/3.png is green"]);
    }
}
