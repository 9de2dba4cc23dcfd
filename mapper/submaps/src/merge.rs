//! From the maps of all groups to one run.

use std::ops::ControlFlow;
use std::time::Instant;

use mba_adjust::bundle::moved_gaussian;
use mba_io::dataset::Dataset;
use mba_io::output::OutputFolder;
use mba_map::map::MAP_FILE;
use mba_raster::gaussians::{Gaussian, Gaussians, read_ply};
use mba_slam::mapping::MapError;
use mba_slam::run::{Run, RunSettings, Summary};
use mba_tracker::geometry::RigidTransform;

use crate::anchors::Anchors;
use crate::brightness::log_factors;
use crate::depth_of_keyframe::DepthView;
use crate::merged_run::MergedRun;
use crate::ownership::Ownership;
use crate::submap::Submap;
use crate::{Job, SubmapError};

/// How a job is merged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MergeSettings {
    /// Leave groups out that are not mapped; their frames keep the poses of the run. Otherwise they are an error.
    pub without_missing: bool,
}

/// What merging did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergeReport {
    /// Groups with a map.
    pub groups: usize,
    /// Groups that were left out.
    pub left_out: usize,
    /// Keyframes that two groups have, counted for each pair of groups.
    pub shared_keyframes: usize,
    /// RMS distance of the two positions of such a keyframe before and after, metres.
    pub disagreement_m: [f64; 2],
    /// Gaussians in all groups, and in the one map.
    pub gaussians: [usize; 2],
}

/// Merges the maps of a job into a RUN folder: the worlds of the groups are moved to agree on the keyframes that they share,
/// their light is made one, and every Gaussian stays in one group only. `describe` becomes the settings of the run; `observe`
/// is called after every group and says whether to go on.
///
/// # Errors
/// The first group that cannot be used, by its file: [`SubmapError::Missing`], [`SubmapError::Foreign`],
/// [`SubmapError::Damaged`]; [`SubmapError::Changed`] for other inputs, and when the run cannot be written.
pub fn merge(
    job: &Job,
    (dataset, run): (&Dataset, &Run),
    settings: MergeSettings,
    out: OutputFolder,
    describe: RunSettings,
    mut observe: impl FnMut(usize) -> ControlFlow<()>,
) -> Result<(Summary, MergeReport), SubmapError> {
    let started = Instant::now();
    job.check_inputs(dataset, run)?;
    let submaps = read_all(job, settings)?;
    let anchors = Anchors::new(&submaps);
    let factors = log_factors(&submaps);
    // Who sees a Gaussian best owns it, so that a surface on a border is there once.
    let witnesses = witnesses(job, &submaps, &anchors.moves);
    let mut furthest = vec![None; witnesses.len()];
    let (mut map, mut all) = (Gaussians::default(), 0);
    for (k, _) in submaps.iter().enumerate().filter(|(_, submap)| submap.is_some()) {
        let group = read_ply(&job.group_folder(k).join(MAP_FILE))?;
        all += group.len();
        // One group is in memory at a time.
        let group = in_one_world(&group, &anchors.moves[k], factors[k]);
        for gaussian in kept(job, dataset, (k, &group), &witnesses, &mut furthest) {
            map.push(&gaussian);
        }
        if observe(k + 1).is_break() {
            return Err(MapError::Stopped.into());
        }
    }
    let report = MergeReport {
        groups: submaps.iter().flatten().count(),
        left_out: submaps.iter().filter(|submap| submap.is_none()).count(),
        shared_keyframes: anchors.shared,
        disagreement_m: anchors.disagreement,
        gaussians: [all, map.len()],
    };
    let merged = MergedRun { job, dataset, run, submaps: &submaps, moves: &anchors.moves, factors: &factors };
    Ok((merged.write(&map, out, describe, started)?, report))
}

/// What every group came to; none for those that may be left out.
fn read_all(job: &Job, settings: MergeSettings) -> Result<Vec<Option<Submap>>, SubmapError> {
    let read = |k: usize| match Submap::read(job, k) {
        Ok(submap) => Ok(Some(submap)),
        Err(SubmapError::Missing { .. }) if settings.without_missing => Ok(None),
        Err(error) => Err(error),
    };
    let submaps: Vec<_> = (0..job.plan.groups.len()).map(read).collect::<Result<_, _>>()?;
    match submaps.iter().any(Option::is_some) {
        true => Ok(submaps),
        false => Err(SubmapError::Missing { folder: job.group_folder(0) }),
    }
}

/// A keyframe that may see a Gaussian best.
struct Witness {
    frame: usize,
    owner: usize,
    /// In the world of all.
    world_from_camera: RigidTransform,
}

/// The keyframes that groups have of their own, in the order of time.
fn witnesses(job: &Job, submaps: &[Option<Submap>], moves: &[RigidTransform]) -> Vec<Witness> {
    let of_group = |(owner, submap): (usize, &Option<Submap>)| {
        let poses = submap.iter().flat_map(|submap| &submap.keyframes);
        let own = poses.filter(|pose| job.plan.owner(pose.frame) == owner);
        let witness = |pose: &crate::SubmapKeyframe| Witness {
            frame: pose.frame,
            owner,
            world_from_camera: moves[owner].compose(&pose.world_from_camera()),
        };
        own.map(witness).collect::<Vec<_>>()
    };
    submaps.iter().enumerate().flat_map(of_group).collect()
}

/// The map of a group in the world and the light of all.
fn in_one_world(map: &Gaussians, world_from_group_world: &RigidTransform, log_factor: f64) -> Gaussians {
    let factor = log_factor.exp() as f32;
    let gaussians = (0..map.len()).filter_map(|index| map.get(index));
    let moved = gaussians.map(|gaussian| {
        let moved = moved_gaussian(&gaussian, world_from_group_world);
        Gaussian { colour: moved.colour.map(|light| light * factor), ..moved }
    });
    moved.collect()
}

/// The Gaussians of group `k` that stay. One depth image is in memory at a time; `furthest` remembers how far each
/// keyframe sees.
fn kept(
    job: &Job,
    dataset: &Dataset,
    (k, group): (usize, &Gaussians),
    witnesses: &[Witness],
    furthest: &mut [Option<f64>],
) -> Vec<Gaussian> {
    let calibration = dataset.calibration();
    let camera = (&calibration.camera, calibration.depth_scale);
    let mut ownership = Ownership::new(group);
    for (witness, furthest) in witnesses.iter().zip(furthest) {
        let away = ownership.distance_from(&witness.world_from_camera.translation);
        // A pixel in the corner is further away than its depth says, by less than this factor.
        if furthest.is_some_and(|furthest| away > 2.0 * furthest) {
            continue;
        }
        let folder = job.group_folder(witness.owner);
        let Some(view) = DepthView::read(&folder, witness.frame, &witness.world_from_camera, camera) else {
            *furthest = Some(0.0);
            continue;
        };
        *furthest = Some(view.furthest());
        ownership.see(&view, witness.owner);
    }
    ownership.kept_by(k).into_iter().filter_map(|index| group.get(index)).collect()
}
