//! Maps of any length: a tracked run is [split](split_run) into groups of keyframes along its path, each is
//! [mapped](map_submap) by itself, in any order and on any machine, and all are [merged](merge()) into one run.
//!
//! A folder `JOB` holds `submaps.json`, the [`Plan`], and for every group a RUN folder `000`, `001`, ... with
//! `submap.json`, the [`Submap`], which is written last. Neither the order of the groups nor the number of processes changes
//! a byte of what comes out.

mod anchors;
mod borders;
mod brightness;
mod depth_of_keyframe;
mod error;
mod groups;
mod job;
mod keyframes;
mod merge;
mod merged_run;
mod ownership;
mod plan;
mod shared_view;
mod split;
mod status;
mod submap;
mod worker;

pub use error::SubmapError;
pub use groups::GroupLimits;
pub use job::Job;
pub use merge::{MergeReport, MergeSettings, merge};
pub use plan::{Group, Plan, PlanSettings};
pub use split::{SplitSettings, split_run};
pub use status::{GroupState, GroupStatus, JobStatus};
pub use submap::{Submap, SubmapKeyframe};
pub use worker::{Worked, estimated_memory_bytes, map_submap};
