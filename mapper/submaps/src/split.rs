//! From a tracked run to a job.

use mba_io::checkpoint::Fingerprint;
use mba_io::dataset::{Dataset, survey};
use mba_io::output::OutputFolder;
use mba_slam::run::{Run, stored_path};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use rayon::prelude::*;

use crate::borders::borders;
use crate::groups::{GroupLimits, cut};
use crate::keyframes::choose_keyframes;
use crate::plan::FORMAT;
use crate::shared_view::{CoarseView, extent};
use crate::{Group, Job, Plan, PlanSettings, SubmapError};

/// Frames from which the typical depth is taken.
const SAMPLED_FRAMES: usize = 16;

/// Typical depth where nothing was measured, metres.
const SOME_DEPTH: f64 = 2.0;

/// Image pixels per Gaussian: a group is described by a sixth as many Gaussians as all that it sees has pixels, and what one
/// camera sees by a third.
const PIXELS_PER_GAUSSIAN: (usize, usize) = (6, 3);

/// How a run is split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitSettings {
    /// Movement of the picture from keyframe to keyframe as a share of its width; 0 for all frames.
    pub keyframe_motion: f64,
    /// Keyframes of a group.
    pub limits: GroupLimits,
    /// Most Gaussians of a group; `None` for as many as what it sees asks for.
    pub max_gaussians: Option<usize>,
    /// How every group is mapped.
    pub mapping: PlanSettings,
}

/// Splits `run`, one of `dataset`, into groups of keyframes along its path, and writes the plan into `out`. `program` is the
/// name and version for the record.
///
/// # Errors
/// [`SubmapError::NoKeyframes`] for a run in which every frame is lost, and when the plan cannot be written.
pub fn split_run(
    dataset: &Dataset,
    run: &Run,
    settings: &SplitSettings,
    out: &OutputFolder,
    program: &str,
) -> Result<Job, SubmapError> {
    let camera = dataset.calibration().camera;
    let depth = survey(dataset, SAMPLED_FRAMES).median_depth.unwrap_or(SOME_DEPTH);
    // A metre of shift at the typical depth, and a radian of turn, move the picture by so many pixels.
    let motion_px = settings.keyframe_motion * camera.width as f64;
    let keyframes = choose_keyframes(&run.exposures, &run.frames, motion_px, [camera.fx / depth, camera.fx]);
    let (keyframes, views) = views(dataset, run, &keyframes, &camera);
    if keyframes.is_empty() {
        return Err(SubmapError::NoKeyframes);
    }
    // Groups and what they see at their borders; indices count keyframes that can be read.
    let poses: Vec<RigidTransform> = keyframes.iter().map(|&index| run.exposures[index].mid).collect();
    let ranges = cut(&poses, &views, &camera, depth, settings.limits);
    let borders = borders(&ranges, &views, &camera, settings.limits.most);
    let gaussians = |range: &std::ops::Range<usize>, border: &[usize]| {
        let seen: Vec<&CoarseView> =
            range.clone().chain(border.iter().copied()).map(|at| &views[at]).collect();
        let pixels = camera.width * camera.height;
        // Room for what all of its views show once, however often they show it; never less than for one view.
        let by_extent = (extent(&seen, &camera) * pixels as f64) as usize / PIXELS_PER_GAUSSIAN.0;
        settings.max_gaussians.unwrap_or(by_extent.max(pixels / PIXELS_PER_GAUSSIAN.1).max(2000))
    };
    // A group ends where the next one's first keyframe is.
    let starts: Vec<usize> = ranges.iter().map(|range| keyframes[range.start]).collect();
    let group = |(k, (range, border)): (usize, (std::ops::Range<usize>, Vec<usize>))| Group {
        // Every frame has an owner: those before the first keyframe too.
        first_frame: if k == 0 { 0 } else { starts[k] },
        end_frame: starts.get(k + 1).copied().unwrap_or(run.exposures.len()),
        max_gaussians: gaussians(&range, &border),
        keyframes: keyframes[range].to_vec(),
        border: border.into_iter().map(|at| keyframes[at]).collect(),
    };
    let groups = ranges.into_iter().zip(borders).enumerate().map(group).collect();
    let plan = Plan {
        format: FORMAT,
        program: program.to_owned(),
        dataset: absolute(dataset.folder()),
        run: absolute(&run.folder),
        dataset_digest: Fingerprint::of_dataset(dataset).to_string(),
        run_digest: run.fingerprint().to_string(),
        settings: settings.mapping,
        frames: run.exposures.len(),
        groups,
    };
    Job::write(out.path(), plan)
}

/// The keyframes that can be read, and their coarse views.
fn views(
    dataset: &Dataset,
    run: &Run,
    keyframes: &[usize],
    camera: &PinholeCamera,
) -> (Vec<usize>, Vec<CoarseView>) {
    let depth_scale = dataset.calibration().depth_scale;
    let view = |&index: &usize| {
        let frame = dataset.frame(index).ok()?;
        Some((index, CoarseView::new(&frame, run.exposures[index].mid, camera, depth_scale)))
    };
    let views: Vec<Option<_>> = keyframes.par_iter().map(view).collect();
    views.into_iter().flatten().unzip()
}

fn absolute(path: &std::path::Path) -> String {
    stored_path(&path.canonicalize().unwrap_or_else(|_| path.to_owned()))
}
