//! What a whole recording says that its beginning did not: every frame is tracked once more, from the last to the first.
//!
//! The first way knows of every frame what came before. The way back knows how the camera moved on both sides of it, also how
//! its acceleration changed, and it has other keyframes. Both measure the same motions with errors of their own; a pose graph
//! of all of them is better than either.

mod backwards;
mod joined;
mod motions;
mod sightings;
mod smoother;

use std::ops::ControlFlow;

use mba_adjust::pose_graph::PoseGraphEdge;
use mba_io::dataset::{Dataset, survey};
use mba_io::statistics::quantile;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::{ExpectedPath, FrameStatus};

use crate::run::{FrameRecord, RunWriter};
use crate::tracking::{Measured, TrackingError, TrackingOptions, tracker_config};
use backwards::SeenBackwards;
use motions::Motions;
use sightings::Sighting;

/// Blur in pixels, of the median frame, from which the way back is worth its time where all rows are exposed together: what it
/// knows better is how the camera moves during an exposure.
const WORTHWHILE_BLUR: f64 = 1.0;

/// Frames that a usual depth is taken from.
const DEPTH_SAMPLES: usize = 8;

/// Tracks the frames of a tracked `run` of `dataset` once more, backwards, and gives the run the poses and exposures that agree
/// best with both ways. `measured` has what each frame was aligned with. `observe` is called before every frame and says
/// whether to go on. Takes as long as tracking did.
///
/// A recording that is sharp, or that is taken for sharp, stays as it is: the way back would know nothing new. Statuses stay,
/// too; a frame that only the way back has found keeps that it was lost.
///
/// # Errors
/// [`TrackingError`]; the run is then as it was.
///
/// # Panics
/// If `measured` or the run is not of all frames of the data set.
pub fn look_back(
    dataset: &Dataset,
    options: &TrackingOptions,
    run: &mut RunWriter,
    measured: &[Measured],
    observe: impl FnMut() -> ControlFlow<()>,
) -> Result<(), TrackingError> {
    assert_eq!(measured.len(), dataset.len(), "what was measured belongs to another data set");
    assert_eq!(run.frames().len(), dataset.len(), "not all frames were tracked");
    if !is_worthwhile(dataset, options, run) {
        return Ok(());
    }
    let expected = expected_paths(dataset, run);
    let seen = backwards::track_backwards(dataset, options, &expected, observe)?;
    let forwards: Vec<RigidTransform> = run.exposures().iter().map(|exposure| exposure.mid).collect();
    let edges = edges(dataset, run, measured, &forwards, &seen);
    // A graph that cannot be solved has numbers that make no sense, as those of a run that tracked nothing.
    let Ok(poses) = joined::joined_poses(forwards, edges) else { return Ok(()) };
    for (frame, pose) in poses.iter().enumerate() {
        let (record, exposure) = (run.frames()[frame], run.exposures()[frame]);
        if !is_found(&record) {
            continue;
        }
        let back = seen[frame].as_ref().filter(|back| back.status == FrameStatus::Ok);
        let blur_px = back.map_or(record.blur_px, |back| 0.5 * (record.blur_px + back.blur_px));
        run.revise(frame, joined::joined_exposure(&exposure, back, pose), blur_px);
    }
    Ok(())
}

/// Whether anything is known better on the way back.
fn is_worthwhile(dataset: &Dataset, options: &TrackingOptions, run: &RunWriter) -> bool {
    let found: Vec<f64> = run.frames().iter().filter(|record| is_found(record)).map(|r| r.blur_px).collect();
    if found.len() < 2 || !dataset.has_images() {
        return false;
    }
    let readout = tracker_config(dataset, options).readout;
    let has_other_times = readout.colour != 0.0 || readout.depth != 0.0 || readout.depth_apart;
    has_other_times || quantile(&found, 0.5).is_some_and(|blur| blur >= WORTHWHILE_BLUR)
}

fn is_found(record: &FrameRecord) -> bool {
    record.status != FrameStatus::Lost
}

/// What both ways measured. The first way is believed; what the way back says is left out where it contradicts the rest.
fn edges(
    dataset: &Dataset,
    run: &RunWriter,
    measured: &[Measured],
    forwards: &[RigidTransform],
    seen: &[Option<SeenBackwards>],
) -> Vec<PoseGraphEdge> {
    let rolls = dataset.calibration().readout.readout_seconds().is_some_and(|seconds| seconds != 0.0);
    let first = run.frames().iter().position(is_found).unwrap_or(0);
    let mut edges = Vec::new();
    for (frame, _) in run.frames().iter().enumerate().filter(|(_, record)| is_found(record)) {
        let is_bent = rolls && measured[frame].reference == first;
        let factor = if is_bent { joined::FIRST_KEYFRAME } else { 1.0 };
        edges.extend(joined::edge(frame, &measured[frame], |k| forwards[k], factor, false));
        if let Some(back) = seen[frame].as_ref().filter(|back| back.status == FrameStatus::Ok) {
            let mid = |k: usize| seen[k].map_or(back.exposure.mid, |seen| seen.exposure.mid);
            edges.extend(joined::edge(frame, &back.measured, mid, 1.0, true));
        }
    }
    edges
}

/// How the camera moves around every frame that was tracked for certain.
fn expected_paths(dataset: &Dataset, run: &RunWriter) -> Vec<Option<ExpectedPath>> {
    let certain = |(index, record): (usize, &FrameRecord)| {
        let exposure = &run.exposures()[index];
        (record.status == FrameStatus::Ok).then(|| Sighting::of(exposure, dataset.exposure_seconds(index)))
    };
    let sightings: Vec<Option<Sighting>> = run.frames().iter().enumerate().map(certain).collect();
    let Some(depth) = survey(dataset, DEPTH_SAMPLES).median_depth else { return vec![None; sightings.len()] };
    let calibration = dataset.calibration();
    let motions = Motions::of(&sightings, &calibration.camera, depth, 1.0 / calibration.frame_rate);
    (0..sightings.len()).map(|index| motions.around(index)).collect()
}
