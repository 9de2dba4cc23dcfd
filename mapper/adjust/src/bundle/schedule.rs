//! What is done when: from coarse to fine, from long steps to short ones.

use mba_map::map::MapKind;
use mba_raster::losses::LossWeights;
use serde::{Deserialize, Serialize};

use super::adam::StepLengths;

/// How one step is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepPlan {
    /// Resolution, 0 is full.
    pub level: usize,
    /// Distance of virtual views along the blur, pixels of the level.
    pub spacing: f64,
    /// Most virtual views.
    pub max_views: usize,
    /// Length of a step of the map, relative to the first.
    pub shrink: f32,
    /// Step lengths of the Gaussians, shrunk.
    pub lengths: StepLengths,
    /// Step length of the paths, full-resolution pixels.
    pub path_pixels: f64,
    /// Whether paths keep their poses at mid exposure, and only the motion around them changes.
    pub only_motions: bool,
    /// Step length of the logarithms of the gains.
    pub log_gain: f64,
    /// Weights of the losses.
    pub weights: LossWeights,
}

/// A part of the schedule.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// Steps without a time budget.
    pub steps: usize,
    /// Share of the time under a time budget.
    pub time_share: f64,
    /// Resolution, 0 is full.
    pub level: usize,
    /// Distance of virtual views along the blur, pixels of the level.
    pub spacing: f64,
    /// Most virtual views.
    pub max_views: usize,
}

/// The stages in order.
///
/// Where a run stands is its *position* from 0 to 1. Without a time budget every step advances it by the same amount
/// within a stage; with one, time does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Schedule {
    stages: Vec<Stage>,
    pace: Pace,
}

/// How a schedule goes from its beginning to its end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Pace {
    /// Lengths of the first steps of the Gaussians.
    lengths: StepLengths,
    /// Until this position steps keep their length, then they shrink.
    hold: f64,
    /// Length of the last step, relative to the first.
    final_length: f64,
    /// Paths and gains rest until this position: a map that has not taken shape pulls all paths together, and what a
    /// chain of frames has drifted takes long to come back.
    paths_from: f64,
    /// First step length of the paths, full-resolution pixels.
    path_pixels: f64,
    /// Whether paths keep their poses at mid exposure.
    only_motions: bool,
    /// The density changes this often while it changes.
    density_changes: f64,
}

/// From a seeded map to a finished one. Steps are twice as long as while it grows, and stay so for most of it: few long ones reach
/// what many short ones do, until what is left is noise of the order in which keyframes come. Not so those of colours: at the
/// border of what was seen they paint what no picture holds.
const WHOLE: Pace = Pace {
    lengths: StepLengths { mean: 0.1, log_scale: 0.04, rotation: 0.02, opacity: 0.05, colour: 0.01 },
    hold: 0.6,
    final_length: 0.1,
    paths_from: 0.15,
    path_pixels: 0.06,
    only_motions: false,
    density_changes: 16.0,
};
/// From a map that has grown frame by frame to a finished one, in a fraction of the time: steps may not become short
/// before the details are there, and paths, which are tracked, have little left to go.
const FINISH: Pace = Pace {
    lengths: GROWING_LENGTHS,
    hold: 0.2,
    final_length: 0.3,
    paths_from: 0.5,
    path_pixels: 0.01,
    only_motions: false,
    density_changes: 6.0,
};
/// From nothing to a finished field. A step sees few pixels: middles, which the tracker has measured with all of them,
/// would only be shaken.
const FIELD: Pace = Pace {
    lengths: GROWING_LENGTHS,
    hold: 0.3,
    final_length: 0.05,
    paths_from: 0.3,
    path_pixels: 0.01,
    only_motions: true,
    density_changes: 0.0,
};
/// Position from which the density is final.
const DENSITY_UNTIL: f64 = 0.6;
/// Visits from which the path of a keyframe moves while the map grows.
const SETTLED: u32 = 6;

/// Step lengths of Gaussians while the map grows and when it is finished, in the units of [`StepLengths`]: a centre moves by a
/// twentieth of the size of its Gaussian. A field has step lengths of its own.
const GROWING_LENGTHS: StepLengths =
    StepLengths { mean: 0.05, log_scale: 0.02, rotation: 0.01, opacity: 0.05, colour: 0.01 };
/// First step length of the logarithm of a gain: a fifth of a percent, half a step of 8 bits in bright light.
const LOG_GAIN: f64 = 2e-3;
/// Weights of the terms of the loss of Gaussians. Colour is the unit, and similarity counts a fifth, as in 3DGS. An error of
/// inverse depth of 0.01/m counts as 0.02 of full scale. Alpha only keeps surfaces from fading.
const WEIGHTS: LossWeights =
    LossWeights { colour: 1.0, similarity: 0.2, depth: 2.0, depth_noise: 0.004, opaque: 0.9, alpha: 0.01 };
/// The same while the map grows: poses at mid exposure rest, so that depth may pull as hard as its own noise allows, 1.5 mm at
/// 1 m, and as soon as anything shows. Later it would pull poses to the noise of single frames.
const GROWING_WEIGHTS: LossWeights = LossWeights { depth: 6.0, depth_noise: 0.0015, opaque: 0.5, ..WEIGHTS };

impl Schedule {
    /// The schedule for a map of some kind.
    #[must_use]
    pub fn of(kind: MapKind, keyframes: usize) -> Self {
        match kind {
            MapKind::Gaussians => Self::new(keyframes),
            MapKind::Field => Self::field(keyframes),
        }
    }

    /// The schedule of Gaussians for a number of keyframes: every one is visited about as often, whatever their number.
    #[must_use]
    pub fn new(keyframes: usize) -> Self {
        let visits = |per_keyframe: usize, least: usize| (keyframes * per_keyframe).max(least);
        // At half resolution a step costs less than half: the map takes shape there, and paths find most of their way, for
        // which few keyframes need as many steps as some dozens.
        let coarse = Stage { steps: visits(3, 200), time_share: 0.1, level: 1, spacing: 3.0, max_views: 9 };
        // Most of the time goes into details. Views 3 pixels apart along the blur cost more than views 4 apart, and are worth
        // more than the steps that could be made instead.
        let fine = Stage { steps: visits(8, 280), time_share: 0.65, level: 0, spacing: 3.0, max_views: 11 };
        // At last there are more views of long blur, so that what they leave out between them is not learnt as an edge.
        let last = Stage { steps: visits(2, 60), time_share: 0.25, level: 0, spacing: 3.0, max_views: 21 };
        Self { stages: vec![coarse, fine, last], pace: WHOLE }
    }

    /// The schedule of a tri-plane field for a number of keyframes. Its steps look at few pixels and are many.
    #[must_use]
    pub fn field(keyframes: usize) -> Self {
        let visits = |per_keyframe: usize, least: usize| (keyframes * per_keyframe).max(least);
        // As for Gaussians; a step is a few thousand pixels, so there are three times as many. A view costs samples along
        // every ray: fewer of them, farther apart.
        let coarse = Stage { steps: visits(15, 300), time_share: 0.1, level: 1, spacing: 3.0, max_views: 5 };
        let fine = Stage { steps: visits(60, 1200), time_share: 0.6, level: 0, spacing: 5.0, max_views: 9 };
        let last = Stage { steps: visits(25, 500), time_share: 0.3, level: 0, spacing: 4.0, max_views: 15 };
        Self { stages: vec![coarse, fine, last], pace: FIELD }
    }

    /// The schedule of `steps` steps that finishes a map which has grown frame by frame.
    #[must_use]
    pub fn finish(steps: usize) -> Self {
        // The map has its coarse shape. Four fifths of the steps are for details, the rest with closer views.
        let last = steps / 5;
        let fine = Stage { steps: steps - last, time_share: 0.8, level: 0, spacing: 6.0, max_views: 11 };
        let last = Stage { steps: last, time_share: 0.2, level: 0, spacing: 4.0, max_views: 11 };
        Self { stages: vec![fine, last], pace: FINISH }
    }

    /// The plan of a step while the map grows, on a keyframe that had so many visits: motions change, the poses at mid
    /// exposure, which the tracker has measured against depth, do not. A map without details would pull them together.
    #[must_use]
    pub fn growing(visits: u32) -> StepPlan {
        let paths = if visits < SETTLED { 0.0 } else { 1.0 };
        StepPlan {
            // Half resolution and views 4 pixels apart, as for the details later: there is time for few steps per frame.
            level: 1,
            spacing: 4.0,
            max_views: 9,
            shrink: 1.0,
            lengths: GROWING_LENGTHS,
            path_pixels: FINISH.path_pixels * paths,
            only_motions: true,
            log_gain: LOG_GAIN * paths,
            weights: GROWING_WEIGHTS,
        }
    }

    /// Steps of all stages without a time budget.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.stages.iter().map(|stage| stage.steps).sum()
    }

    /// The stage at a position, by its number from 0.
    #[must_use]
    pub fn stage(&self, position: f64, timed: bool) -> usize {
        let mut end = 0.0;
        for (k, stage) in self.stages.iter().enumerate() {
            end += self.share(stage, timed);
            if position < end {
                return k;
            }
        }
        self.stages.len().saturating_sub(1)
    }

    /// Share of a stage in the positions.
    fn share(&self, stage: &Stage, timed: bool) -> f64 {
        if timed { stage.time_share } else { stage.steps as f64 / self.steps().max(1) as f64 }
    }

    /// The plan of the step at a position.
    #[must_use]
    pub fn plan(&self, position: f64, timed: bool) -> StepPlan {
        let stage = self.stages[self.stage(position, timed)];
        let Pace { lengths, hold, final_length, paths_from, path_pixels, only_motions, .. } = self.pace;
        // From its first to its last length a step shrinks by the same factor in equal parts of the schedule.
        let shrink = final_length.powf((position - hold).max(0.0) / (1.0 - hold));
        let paths = if position < paths_from { 0.0 } else { shrink };
        StepPlan {
            level: stage.level,
            spacing: stage.spacing,
            max_views: stage.max_views,
            shrink: shrink as f32,
            lengths: lengths.scaled(shrink as f32),
            path_pixels: path_pixels * paths,
            only_motions,
            log_gain: LOG_GAIN * paths,
            weights: WEIGHTS,
        }
    }

    /// Whether the density changes between two positions.
    #[must_use]
    pub fn density_changes(&self, before: f64, after: f64) -> bool {
        let changes = self.pace.density_changes;
        // Changes are evenly spaced up to where the density is final.
        let count = |position: f64| (position.min(DENSITY_UNTIL) * changes / DENSITY_UNTIL).floor();
        count(after) > count(before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_follow_each_other_and_end_at_full_resolution() {
        let schedule = Schedule::new(50);
        assert_eq!(schedule.steps(), 200 + 50 * 10);
        for timed in [false, true] {
            let stages: Vec<usize> = (0..=100).map(|k| schedule.stage(f64::from(k) / 100.0, timed)).collect();
            assert!(stages.is_sorted() && stages[0] == 0 && stages[100] == 2, "{stages:?}");
        }
        assert_eq!(schedule.plan(0.0, false).level, 1);
        assert_eq!(schedule.plan(1.5, true).level, 0);
    }

    #[test]
    fn steps_shrink_and_paths_start_late() {
        let schedule = Schedule::new(10);
        let [start, middle, end] = [0.0, 0.5, 1.0].map(|position| schedule.plan(position, false));
        assert_eq!((start.path_pixels, start.log_gain), (0.0, 0.0));
        assert!(middle.path_pixels > end.path_pixels && end.path_pixels > 0.0);
        assert!((end.lengths.mean / start.lengths.mean - 0.1).abs() < 1e-3);
    }

    #[test]
    fn a_map_that_has_grown_is_finished_at_full_resolution_with_steps_that_stay_long() {
        let schedule = Schedule::finish(100);
        assert_eq!(schedule.steps(), 100);
        let [start, late, end] = [0.0, 0.6, 1.0].map(|position| schedule.plan(position, false));
        assert!(start.level == 0 && end.spacing < start.spacing);
        assert!(start.path_pixels == 0.0 && late.path_pixels > end.path_pixels && !late.only_motions);
        assert!((end.lengths.mean / start.lengths.mean - 0.3).abs() < 1e-3);
        assert_eq!(Schedule::growing(0).path_pixels, 0.0);
        let settled = Schedule::growing(SETTLED);
        assert!(settled.path_pixels > 0.0 && settled.only_motions);
    }

    #[test]
    fn a_field_is_seen_often_and_keeps_the_middles_of_paths() {
        let schedule = Schedule::of(MapKind::Field, 64);
        assert_eq!(schedule.steps(), 64 * 100);
        let [start, end] = [0.0, 1.0].map(|position| schedule.plan(position, false));
        assert_eq!((start.shrink, start.path_pixels), (1.0, 0.0));
        assert!((end.shrink - 0.05).abs() < 1e-3 && end.path_pixels > 0.0 && end.only_motions);
        let changes = (0..100).filter(|&k| {
            let at = |k: u32| f64::from(k) / 100.0;
            schedule.density_changes(at(k), at(k + 1))
        });
        assert_eq!(changes.count(), 0);
    }

    #[test]
    fn the_density_changes_sixteen_times_and_then_no_more() {
        let schedule = Schedule::new(10);
        let at = |k: u32| f64::from(k) / 1000.0;
        let changes = (0..1000).filter(|&k| schedule.density_changes(at(k), at(k + 1))).count();
        assert_eq!(changes, 16);
        assert!(!schedule.density_changes(0.61, 1.0));
    }
}
