//! What the tracker's thread knows after a frame.

use std::collections::VecDeque;

use mba_io::checkpoint::exact_poses::{PoseNumbers, numbers, pose};
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::{SessionError, Tracker};
use serde::{Deserialize, Serialize};

/// Frames that stay known by both of their numbers: the tracker revises none that is older.
const KNOWN: usize = 8;

/// All that outlives a frame in the tracker's thread, bit for bit: about 1 MB for images of 320x240.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct TrackerState {
    session: Vec<u8>,
    recent: RecentFrames,
    moves: usize,
    last: Option<(f64, [PoseNumbers; 3])>,
}

/// The same in use, without the tracker itself.
#[derive(Clone, Debug, Default)]
pub(super) struct ThreadState {
    /// The frames of the data set that the tracker was given last.
    pub(super) recent: RecentFrames,
    /// Moves of the world that the tracker has made.
    pub(super) moves: usize,
    /// The last exposure, for frames without one.
    pub(super) last: Option<TimedExposure>,
}

impl TrackerState {
    /// What is known now, in the memory of `spent`.
    pub(super) fn of(tracker: &mut Tracker<'_>, state: &ThreadState, spent: Vec<u8>) -> Self {
        let mut session = spent;
        session.clear();
        tracker.save(&mut |part| session.extend_from_slice(part));
        let ThreadState { recent, moves, last } = state.clone();
        let last = last.map(|TimedExposure { timestamp, start, mid, end }| {
            (timestamp, [start, mid, end].map(|pose| numbers(&pose)))
        });
        Self { session, recent, moves, last }
    }

    /// The memory of what is not needed any more.
    pub(super) fn into_memory(self) -> Vec<u8> {
        self.session
    }

    /// Puts a tracker with the same configuration where that one was; returns what else the thread knew.
    ///
    /// # Errors
    /// [`SessionError`] when this was not saved by such a tracker.
    pub(super) fn restore(self, tracker: &mut Tracker<'_>) -> Result<ThreadState, SessionError> {
        let Self { session, recent, moves, last } = self;
        tracker.restore(&session)?;
        let last = last.map(|(timestamp, poses)| {
            let [start, mid, end] = poses.map(pose);
            TimedExposure { timestamp, start, mid, end }
        });
        Ok(ThreadState { recent, moves, last })
    }
}

/// The tracker counts the frames it was given, the run those of the data set; only the last few are asked for.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct RecentFrames {
    /// Number that the tracker will give to the next frame.
    next: usize,
    indices: VecDeque<usize>,
}

impl RecentFrames {
    /// The tracker was given frame `index` of the data set.
    pub(super) fn push(&mut self, index: usize) {
        self.indices.push_back(index);
        self.next = self.next.saturating_add(1);
        if self.indices.len() > KNOWN {
            self.indices.pop_front();
        }
    }

    /// Index in the data set of the frame that has this number for the tracker.
    pub(super) fn index(&self, number: usize) -> Option<usize> {
        let first = self.next.checked_sub(self.indices.len())?;
        self.indices.get(number.checked_sub(first)?).copied()
    }

    /// Index in the data set of the newest frame.
    pub(super) fn newest(&self) -> Option<usize> {
        self.indices.back().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_frames_that_were_given_are_known() {
        let mut recent = RecentFrames::default();
        assert_eq!((recent.index(0), recent.newest()), (None, None));
        (0..20).for_each(|number| recent.push(2 * number));
        assert_eq!((recent.index(19), recent.index(12), recent.newest()), (Some(38), Some(24), Some(38)));
        assert_eq!((recent.index(11), recent.index(20)), (None, None));
    }
}
