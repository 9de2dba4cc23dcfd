//! What a whole recording says that its beginning did not: every frame is tracked once more, from the last to the first.
//!
//! The first way knows of every frame what came before. The way back knows how the camera moved on both sides of it, also how
//! its acceleration changed, and it has other keyframes. Both measure the same motions with errors of their own; a pose graph
//! of all of them is better than either.

mod backwards;
mod joined;
mod motions;
mod revisits;
mod sightings;
mod smoother;

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use mba_adjust::pose_graph::PoseGraphEdge;
use mba_io::dataset::{Dataset, survey};
use mba_io::statistics::quantile;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::{ExpectedPath, FrameStatus, TrackerConfig};

use crate::run::{FrameRecord, Reason, TrackRecord};
use crate::tracking::{Measured, TrackingError, TrackingOptions, tracker_config};
use backwards::SeenBackwards;
use joined::{Ends, Joined};
use motions::Motions;
use sightings::Sighting;

/// Blur in pixels, of the median frame, from which the way back is worth its time where all rows are exposed together: what it
/// knows better is how the camera moves during an exposure.
const WORTHWHILE_BLUR: f64 = 1.0;

/// Frames that a usual depth is taken from.
const DEPTH_SAMPLES: usize = 8;

/// Tracks the frames of `dataset`, of which `track` is what tracking found, once more, backwards, and gives it the poses and exposures that agree
/// best with both ways. `measured` has what each frame was aligned with. `observe` is called before every frame and says
/// whether to go on. Takes as long as tracking did.
///
/// A recording that is sharp, or that is taken for sharp, stays as it is unless frames are lost that show something: the way
/// back would know nothing new. A frame that only the way back has found becomes weak; all other statuses stay.
///
/// # Errors
/// [`TrackingError`]; the record is then as it was.
///
/// # Panics
/// If `measured` or the record is not of all frames of the data set.
pub fn look_back(
    dataset: &Dataset,
    options: &TrackingOptions,
    track: &mut TrackRecord,
    measured: &[Measured],
    observe: impl FnMut() -> ControlFlow<()>,
) -> Result<(), TrackingError> {
    assert_eq!(measured.len(), dataset.len(), "what was measured belongs to another data set");
    assert_eq!(track.frames().len(), dataset.len(), "not all frames were tracked");
    if !is_worthwhile(dataset, options, track) {
        return Ok(());
    }
    let expected = expected_paths(dataset, track);
    let seen = backwards::track_backwards(dataset, options, &expected, observe)?;
    let forwards = first_estimates(track, &seen);
    let ways = edges(dataset, track, measured, &forwards, &seen);
    // A graph that cannot be solved has numbers that make no sense, as those of a run that tracked nothing.
    let Ok(both) = joined::joined(forwards.clone(), &ways, &[]) else { return Ok(()) };
    revise(track, &seen, &both);
    let again = places_seen_again(dataset, options, track);
    if !again.is_empty()
        && let Ok(all) = joined::joined(forwards, &ways, &again)
    {
        let moves = |frame: usize| all.world_from_mid[frame].compose(&both.world_from_mid[frame].inverse());
        track.move_world(moves);
    }
    Ok(())
}

/// Where the frames were seen on the way forwards; of one that only the way back has found, where it would have been, if both
/// ways agreed on the nearest frame that both have found.
fn first_estimates(track: &TrackRecord, seen: &[Option<SeenBackwards>]) -> Vec<RigidTransform> {
    let (records, exposures) = (track.frames(), track.exposures());
    let of_back = |frame: usize| {
        seen[frame].filter(|back| back.status == FrameStatus::Ok).map(|back| back.exposure.mid)
    };
    let shared: Vec<usize> =
        (0..records.len()).filter(|&k| is_found(&records[k]) && of_back(k).is_some()).collect();
    let estimate = |frame: usize| {
        let held = exposures[frame].mid;
        if is_found(&records[frame]) {
            return held;
        }
        let nearest = shared.iter().min_by_key(|shared| shared.abs_diff(frame));
        let moved = nearest.and_then(|&nearest| {
            let world_from_back = exposures[nearest].mid.compose(&of_back(nearest)?.inverse());
            Some(world_from_back.compose(&of_back(frame)?))
        });
        moved.unwrap_or(held)
    };
    (0..records.len()).map(estimate).collect()
}

/// Whether anything is known better on the way back.
fn is_worthwhile(dataset: &Dataset, options: &TrackingOptions, track: &TrackRecord) -> bool {
    let found: Vec<f64> =
        track.frames().iter().filter(|record| is_found(record)).map(|r| r.blur_px).collect();
    if found.len() < 2 || !dataset.has_images() {
        return false;
    }
    // What shows nothing, or cannot be read, is lost on any way.
    let is_missed = |record: &FrameRecord| {
        !is_found(record) && !matches!(record.reason, Some(Reason::Blind | Reason::Skipped))
    };
    has_other_times(&tracker_config(dataset, options))
        || track.frames().iter().any(is_missed)
        || quantile(&found, 0.5).is_some_and(|blur| blur >= WORTHWHILE_BLUR)
}

/// Whether rows, or depth, are measured at other times than the middle of the image.
fn has_other_times(config: &TrackerConfig) -> bool {
    let readout = config.readout;
    readout.colour != 0.0 || readout.depth != 0.0 || readout.depth_apart
}

fn is_found(record: &FrameRecord) -> bool {
    record.status != FrameStatus::Lost
}

/// What keyframes measure of places that were seen long before; nothing where rows or depth have times of their own, which
/// only the tracker puts right.
fn places_seen_again(
    dataset: &Dataset,
    options: &TrackingOptions,
    track: &TrackRecord,
) -> Vec<PoseGraphEdge> {
    let config = tracker_config(dataset, options);
    if has_other_times(&config) {
        return Vec::new();
    }
    let is_certain = |index: usize| track.frames()[index].status == FrameStatus::Ok;
    let keyframes: Vec<usize> =
        track.keyframes().into_iter().map(|(index, _)| index).filter(|index| is_certain(*index)).collect();
    revisits::revisits(dataset, &config, &keyframes, track.exposures())
}

/// Gives the frames of a run the poses and exposures that agree best with both ways.
fn revise(track: &mut TrackRecord, seen: &[Option<SeenBackwards>], joined: &Joined) {
    let found = |(frame, record): (usize, &FrameRecord)| is_found(record).then(|| joined.part[frame]);
    let known: BTreeSet<usize> = track.frames().iter().enumerate().filter_map(found).collect();
    for (frame, pose) in joined.world_from_mid.iter().enumerate() {
        let (record, exposure) = (track.frames()[frame], track.exposures()[frame]);
        let [mut forwards_agrees, back_agrees] = joined.agrees[frame];
        if !is_found(&record) {
            // What only the way back has found is known if it is tied to what the first way has found.
            let is_seen = seen[frame].is_some_and(|back| back.status == FrameStatus::Ok) && back_agrees;
            if !(is_seen && known.contains(&joined.part[frame])) {
                continue;
            }
            track.recover(frame, pose);
            forwards_agrees = false;
        }
        let back = seen[frame].as_ref().filter(|back| back.status == FrameStatus::Ok && back_agrees);
        let blur_px = match back {
            Some(back) if forwards_agrees => 0.5 * (record.blur_px + back.blur_px),
            Some(back) => back.blur_px,
            None => record.blur_px,
        };
        let ends = Ends { forwards: &exposure, forwards_agrees, back };
        track.revise(frame, ends.around(pose), blur_px);
    }
}

/// What both ways measured of every frame. A frame that was found on the way back is measured twice, and either may be a
/// mistake; what was measured once is believed.
fn edges(
    dataset: &Dataset,
    track: &TrackRecord,
    measured: &[Measured],
    forwards: &[RigidTransform],
    seen: &[Option<SeenBackwards>],
) -> Vec<[Option<PoseGraphEdge>; 2]> {
    let rolls = dataset.calibration().readout.readout_seconds().is_some_and(|seconds| seconds != 0.0);
    let first = track.frames().iter().position(is_found).unwrap_or(0);
    let both = |(frame, record): (usize, &FrameRecord)| {
        let back = seen[frame].as_ref().filter(|back| back.status == FrameStatus::Ok).and_then(|back| {
            let mid = |k: usize| seen[k].map_or(back.exposure.mid, |seen| seen.exposure.mid);
            joined::edge(frame, &back.measured, mid, 1.0, is_found(record))
        });
        if !is_found(record) {
            return [None, back];
        }
        let is_bent = rolls && measured[frame].reference == first;
        let factor = if is_bent { joined::FIRST_KEYFRAME } else { 1.0 };
        [joined::edge(frame, &measured[frame], |k| forwards[k], factor, back.is_some()), back]
    };
    track.frames().iter().enumerate().map(both).collect()
}

/// How the camera moves around every frame that was tracked for certain.
fn expected_paths(dataset: &Dataset, track: &TrackRecord) -> Vec<Option<ExpectedPath>> {
    let certain = |(index, record): (usize, &FrameRecord)| {
        let exposure = &track.exposures()[index];
        (record.status == FrameStatus::Ok).then(|| Sighting::of(exposure, dataset.exposure_seconds(index)))
    };
    let sightings: Vec<Option<Sighting>> = track.frames().iter().enumerate().map(certain).collect();
    let Some(depth) = survey(dataset, DEPTH_SAMPLES).median_depth else { return vec![None; sightings.len()] };
    let calibration = dataset.calibration();
    let motions = Motions::of(&sightings, &calibration.camera, depth, 1.0 / calibration.frame_rate);
    (0..sightings.len()).map(|index| motions.around(index)).collect()
}
