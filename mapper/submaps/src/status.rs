//! How far a job is.

use mba_io::run_layout::{CHECKPOINT_FILE, SUMMARY_FILE};
use serde::Serialize;

use crate::submap::Submap;
use crate::{Job, SubmapError};

/// How far a group is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum GroupState {
    /// Nothing was done.
    Waiting,
    /// A process is at work, or was stopped.
    Begun,
    /// Its map was made for another plan, or has changed since; it is made again.
    Stale,
    /// Mapped.
    Done,
}

/// One group of a job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct GroupStatus {
    /// Number of the group.
    pub group: usize,
    /// How far it is.
    pub state: GroupState,
    /// Keyframes of its own.
    pub keyframes: usize,
    /// Keyframes of others that it is mapped with.
    pub border: usize,
    /// Frames that are its own.
    pub frames: usize,
}

/// How far a job is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct JobStatus {
    /// Groups that are mapped.
    pub done: usize,
    /// All groups.
    pub groups: Vec<GroupStatus>,
}

impl JobStatus {
    /// Looks at the files of a job.
    #[must_use]
    pub fn of(job: &Job) -> Self {
        let status = |(k, group): (usize, &crate::Group)| GroupStatus {
            group: k,
            state: state(job, k),
            keyframes: group.keyframes.len(),
            border: group.border.len(),
            frames: group.frames().len(),
        };
        let groups: Vec<GroupStatus> = job.plan.groups.iter().enumerate().map(status).collect();
        let done = groups.iter().filter(|group| group.state == GroupState::Done).count();
        Self { done, groups }
    }
}

fn state(job: &Job, k: usize) -> GroupState {
    let folder = job.group_folder(k);
    match Submap::read(job, k) {
        Ok(_) => GroupState::Done,
        Err(SubmapError::Missing { .. }) => {
            let is_begun = [CHECKPOINT_FILE, SUMMARY_FILE].iter().any(|name| folder.join(name).is_file());
            if is_begun { GroupState::Begun } else { GroupState::Waiting }
        }
        Err(_) => GroupState::Stale,
    }
}
