//! `submaps.json`: which group has which keyframes and frames.

use std::ops::Range;
use std::time::Duration;

use mba_slam::mapping::{MapPart, MapSettings};
use serde::{Deserialize, Serialize};

/// Version of the layout.
pub(crate) const FORMAT: u32 = 1;

/// Most Gaussians of a group: more than any machine renders.
const MOST_GAUSSIANS: usize = 100_000_000;

/// Most frames of a run, as many as a data set of a day has.
const MOST_FRAMES: usize = 10_000_000;

/// How a run was split.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Version of this layout.
    pub format: u32,
    /// Program and version that split the run.
    pub program: String,
    /// Folder of the data set.
    pub dataset: String,
    /// RUN folder that was split.
    pub run: String,
    /// Fingerprint of the frames and the calibration of the data set, 16 hexadecimal digits.
    pub dataset_digest: String,
    /// Fingerprint of the poses and records of the run.
    pub run_digest: String,
    /// How every group is mapped.
    pub settings: PlanSettings,
    /// Frames of the run.
    pub frames: usize,
    /// The groups in the order of time.
    pub groups: Vec<Group>,
}

/// How every group is mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlanSettings {
    /// Whether motion during the exposure is modelled.
    pub blur: bool,
    /// Whether frames are repaired by what their neighbours do.
    pub continuity: bool,
    /// Upper bound of virtual views per exposure; none for the schedule's own.
    pub virtual_views: Option<usize>,
    /// Seed of the order in which keyframes are visited.
    pub seed: u64,
}

/// Keyframes that are mapped together. All numbers are indices of frames in the data set, ascending.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Group {
    /// The first frame that is this group's.
    pub first_frame: usize,
    /// The frame after the last one.
    pub end_frame: usize,
    /// Its keyframes, among its frames.
    pub keyframes: Vec<usize>,
    /// Keyframes of other groups that it is mapped with, too.
    pub border: Vec<usize>,
    /// Most Gaussians of its map.
    pub max_gaussians: usize,
}

impl PlanSettings {
    /// The settings of the map of a group, with so much time between two checkpoints.
    pub(crate) fn mapping(&self, group: &Group, checkpoint_interval: Duration) -> MapSettings {
        let Self { blur, continuity, virtual_views, seed } = *self;
        MapSettings {
            blur,
            continuity,
            virtual_views,
            max_gaussians: Some(group.max_gaussians),
            seed,
            checkpoint_interval,
            ..MapSettings::default()
        }
    }
}

impl Group {
    /// The frames that are this group's.
    #[must_use]
    pub fn frames(&self) -> Range<usize> {
        self.first_frame..self.end_frame
    }

    /// What of the run is mapped.
    #[must_use]
    pub fn part(&self) -> MapPart {
        let mut keyframes: Vec<usize> = self.keyframes.iter().chain(&self.border).copied().collect();
        keyframes.sort_unstable();
        MapPart { keyframes, frames: self.frames() }
    }
}

impl Plan {
    /// What is wrong with the plan, if anything is: every frame has one owner, and every keyframe is a frame of its group.
    pub(crate) fn check(&self) -> Result<(), String> {
        if self.format != FORMAT {
            return Err(format!("format is {}, this version reads {FORMAT}", self.format));
        }
        if self.frames == 0 || self.frames > MOST_FRAMES {
            return Err(format!("frames is {}, expected 1 to {MOST_FRAMES}", self.frames));
        }
        // Groups follow each other without gaps and overlaps.
        let mut next = 0;
        for (k, group) in self.groups.iter().enumerate() {
            if group.first_frame != next || group.end_frame <= next || group.end_frame > self.frames {
                let (first, end) = (group.first_frame, group.end_frame);
                return Err(format!(
                    "group {k} has the frames {first} to {end}, expected a range from {next}"
                ));
            }
            next = group.end_frame;
            if group.max_gaussians > MOST_GAUSSIANS {
                let count = group.max_gaussians;
                return Err(format!(
                    "group {k}: max_gaussians is {count}, expected at most {MOST_GAUSSIANS}"
                ));
            }
            // Lists are searched by bisection, so that they have to ascend.
            let [own, border] = [&group.keyframes, &group.border];
            let is_ascending = |list: &[usize]| list.windows(2).all(|pair| pair[0] < pair[1]);
            let is_own = own.iter().all(|index| group.frames().contains(index));
            let is_of_others = border.iter().all(|&index| self.is_keyframe_of_others(k, index));
            if own.is_empty() || !is_ascending(own) || !is_ascending(border) || !is_own || !is_of_others {
                return Err(format!(
                    "group {k}: keyframes must be own ones, border those of other groups, ascending"
                ));
            }
        }
        if next == self.frames { Ok(()) } else { Err(format!("the frames from {next} on are in no group")) }
    }

    fn is_keyframe_of_others(&self, k: usize, index: usize) -> bool {
        let owner = self.owner(index);
        owner != k
            && self.groups.get(owner).is_some_and(|group| group.keyframes.binary_search(&index).is_ok())
    }

    /// The group that frame `index` belongs to; one beyond the last for a frame that there is not.
    #[must_use]
    pub fn owner(&self, index: usize) -> usize {
        self.groups.partition_point(|group| group.end_frame <= index)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn plan() -> Plan {
        let group = |first_frame, end_frame, keyframes: &[usize], border: &[usize]| Group {
            first_frame,
            end_frame,
            keyframes: keyframes.to_vec(),
            border: border.to_vec(),
            max_gaussians: 2000,
        };
        Plan {
            format: FORMAT,
            program: "mba test".into(),
            dataset: "data".into(),
            run: "run".into(),
            dataset_digest: "00".into(),
            run_digest: "11".into(),
            settings: PlanSettings { blur: true, continuity: true, virtual_views: None, seed: 1 },
            frames: 20,
            groups: vec![group(0, 9, &[1, 4, 7], &[10, 18]), group(9, 20, &[10, 14, 18], &[4, 7])],
        }
    }

    #[test]
    fn every_frame_has_one_owner() {
        assert_eq!(plan().check(), Ok(()));
        assert_eq!([0, 8, 9, 19, 20].map(|index| plan().owner(index)), [0, 0, 1, 1, 2]);
        type Spoil = fn(&mut Plan);
        let spoilt: [(Spoil, &str); 5] = [
            (|plan| plan.format = 7, "format is 7"),
            (
                |plan| plan.groups[1].first_frame = 8,
                "group 1 has the frames 8 to 20, expected a range from 9",
            ),
            (|plan| plan.groups[1].end_frame = 19, "the frames from 19 on are in no group"),
            (|plan| plan.groups[0].border[0] = 11, "group 0: keyframes must be own"),
            (|plan| plan.groups[0].keyframes = vec![4, 1], "group 0: keyframes must be own"),
        ];
        for (spoil, expected) in spoilt {
            let mut plan = plan();
            spoil(&mut plan);
            let message = plan.check().unwrap_err();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
