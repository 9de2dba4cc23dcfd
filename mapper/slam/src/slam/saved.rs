//! Checkpoints of a run in lock step.
//!
//! While frames come in, a checkpoint holds what the mapper knows, what the tracker knew after the newest frame that was
//! mapped, and what the mapper has told it that it had not heard of by then. Keyframes' images and descriptions of places
//! come from the data set again.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mba_adjust::bundle::{BorrowedBundleState, BundleState, MapKeyframe};
use mba_io::checkpoint::exact_poses::{PoseNumbers, numbers, pose};
use mba_io::checkpoint::{CheckpointError, Fingerprint, Identity, save};
use mba_io::dataset::Dataset;
use serde::{Deserialize, Serialize};

use super::SlamSettings;
use super::messages::{AHEAD, Instruction, SharpView};
use super::tracker_state::TrackerState;
use crate::mapping::{Running, dataset_fingerprint};
use crate::run::RunRows;

/// Layout of the content.
const VERSION: u32 = 4;

/// Time until the first checkpoint: a run that is stopped sooner has nothing worth keeping.
const FIRST_AFTER: Duration = Duration::from_secs(1);

/// A checkpoint as it is read.
#[derive(Deserialize)]
pub(super) enum Saved {
    Growing { mapper: Box<MapperParts>, state: BundleState },
    Refining { parts: Box<RefiningParts>, state: BundleState },
}

/// The same as it is written.
#[derive(Serialize)]
pub(super) enum Saving<'a> {
    Growing { mapper: Box<MapperParts>, state: BorrowedBundleState<'a> },
    Refining { parts: &'a RefiningParts, state: BorrowedBundleState<'a> },
}

/// What the mapper knows besides map and paths.
#[derive(Serialize, Deserialize)]
pub(super) struct MapperParts {
    pub(super) rows: RunRows,
    pub(super) keyframes: Vec<SavedKeyframe>,
    pub(super) max_gaussians: usize,
    pub(super) growth: Growth,
    pub(super) loops: SavedLoops,
    pub(super) moves: Vec<PoseNumbers>,
    pub(super) counts: Counts,
    pub(super) on_map: bool,
    pub(super) undisputed: usize,
    /// How far picture and depth contradict each other, of each frame that was tracked.
    pub(super) disagreements: Vec<f64>,
    /// What the tracker's thread knew after the newest frame.
    pub(super) tracker: TrackerState,
    /// What the tracker was told after frames of which it had not heard by then.
    pub(super) instructions: VecDeque<(usize, SavedInstruction)>,
    /// Seconds that the run took so far.
    pub(super) seconds: f64,
}

/// What is needed to go on with the refinement.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct RefiningParts {
    pub(super) rows: RunRows,
    pub(super) keyframes: Vec<SavedKeyframe>,
    pub(super) max_gaussians: usize,
    pub(super) schedule_steps: usize,
    pub(super) running: Running,
    pub(super) counts: Counts,
    pub(super) loops: usize,
    pub(super) retired: usize,
    pub(super) live_frames_per_second: f64,
    pub(super) tracked_ate_m: Option<f64>,
    pub(super) seconds: f64,
}

/// Index of a keyframe in the data set, and where the tracker found its middle.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct SavedKeyframe {
    pub(super) index: usize,
    pub(super) middle: PoseNumbers,
}

impl From<&MapKeyframe> for SavedKeyframe {
    fn from(keyframe: &MapKeyframe) -> Self {
        Self { index: keyframe.index, middle: numbers(&keyframe.prior.middle) }
    }
}

/// How far the map has grown.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct Growth {
    pub(super) effort: f64,
    pub(super) steps: usize,
    pub(super) seen: f64,
    pub(super) retired: usize,
}

/// Loops that were closed: both frames and the motion between them.
#[derive(Serialize, Deserialize)]
pub(super) struct SavedLoops {
    pub(super) closed: Vec<(usize, usize, PoseNumbers)>,
    pub(super) pause: usize,
}

/// What was counted.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct Counts {
    pub(super) frames_on_map: usize,
    pub(super) late_frames: usize,
    pub(super) relocalisations: usize,
}

/// An instruction that was not empty.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct SavedInstruction {
    world_move: Option<PoseNumbers>,
    reference: Option<SavedView>,
}

#[derive(Clone, Serialize, Deserialize)]
struct SavedView {
    rgb: Vec<u8>,
    depth: Vec<u16>,
    world_from_camera: PoseNumbers,
    start_from: Option<PoseNumbers>,
}

impl SavedInstruction {
    /// Of an instruction that says something.
    fn of(instruction: &Instruction) -> Option<Self> {
        let view = |view: &SharpView| SavedView {
            rgb: view.rgb.clone(),
            depth: view.depth.clone(),
            world_from_camera: numbers(&view.world_from_camera),
            start_from: view.start_from.as_ref().map(numbers),
        };
        let Instruction { world_move, reference, spent: _ } = instruction;
        let says_something = world_move.is_some() || reference.is_some();
        says_something.then(|| Self {
            world_move: world_move.as_ref().map(numbers),
            reference: reference.as_ref().map(view),
        })
    }
}

impl From<SavedInstruction> for Instruction {
    fn from(saved: SavedInstruction) -> Self {
        let view = |view: SavedView| SharpView {
            rgb: view.rgb,
            depth: view.depth,
            world_from_camera: pose(view.world_from_camera),
            start_from: view.start_from.map(pose),
        };
        Self {
            world_move: saved.world_move.map(pose),
            reference: saved.reference.map(view),
            ..Self::default()
        }
    }
}

/// What the tracker's thread goes on from.
pub(super) struct Replay {
    /// Frames that were mapped before.
    pub(super) frames: usize,
    /// What the thread knew after the last of them.
    pub(super) knows: TrackerState,
    instructions: VecDeque<(usize, SavedInstruction)>,
    /// The checkpoint that all this comes from.
    pub(super) path: PathBuf,
}

impl Replay {
    pub(super) fn new(
        (frames, knows): (usize, TrackerState),
        instructions: VecDeque<(usize, SavedInstruction)>,
        path: PathBuf,
    ) -> Self {
        Self { frames, knows, instructions, path }
    }

    /// What the tracker was told after frame `index`, which was mapped before.
    pub(super) fn take(&mut self, index: usize) -> Instruction {
        let known = self.instructions.iter().position(|(after, _)| *after == index);
        let told = known.and_then(|at| self.instructions.remove(at));
        told.map_or_else(Instruction::default, |(_, told)| told.into())
    }
}

/// Where and how often the mapper's state is kept.
pub(super) struct Keeper {
    path: PathBuf,
    identity: Identity,
    interval: Duration,
    started: Instant,
    /// Seconds of the run before it was stopped.
    earlier: f64,
    saved: Option<Instant>,
    /// What the tracker has not heard of when it hands over the newest frame.
    instructions: VecDeque<(usize, SavedInstruction)>,
}

impl Keeper {
    pub(super) fn new(path: PathBuf, identity: Identity, interval: Duration) -> Self {
        let started = Instant::now();
        Self { path, identity, interval, started, earlier: 0.0, saved: None, instructions: VecDeque::new() }
    }

    /// Goes on after `seconds` in which these instructions were given.
    pub(super) fn go_on(&mut self, seconds: f64, instructions: VecDeque<(usize, SavedInstruction)>) {
        (self.earlier, self.instructions) = (seconds, instructions);
    }

    /// Time for the run so far.
    pub(super) fn seconds(&self) -> f64 {
        self.earlier + self.started.elapsed().as_secs_f64()
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn interval(&self) -> Duration {
        self.interval
    }

    /// Notes what the tracker is told after frame `index`. Of what it was told [`AHEAD`] frames ago it has heard.
    pub(super) fn note(&mut self, index: usize, instruction: &Instruction) {
        self.instructions.retain(|(after, _)| after + AHEAD > index);
        self.instructions.extend(SavedInstruction::of(instruction).map(|saved| (index, saved)));
    }

    /// Whether it is time for another checkpoint.
    pub(super) fn is_due(&self) -> bool {
        let waited = self.saved.map_or_else(|| self.started.elapsed(), |saved| saved.elapsed());
        let wait = if self.saved.is_some() { self.interval } else { self.interval.min(FIRST_AFTER) };
        waited >= wait
    }

    /// Writes a checkpoint while frames come in.
    pub(super) fn save_growing(
        &mut self,
        parts: impl FnOnce(VecDeque<(usize, SavedInstruction)>, f64) -> MapperParts,
        state: BorrowedBundleState<'_>,
    ) -> Result<(), CheckpointError> {
        self.saved = Some(Instant::now());
        let mapper = Box::new(parts(self.instructions.clone(), self.seconds()));
        self.write(&Saving::Growing { mapper, state })
    }

    /// Writes a checkpoint.
    pub(super) fn write(&self, saving: &Saving<'_>) -> Result<(), CheckpointError> {
        save(&self.path, &self.identity, saving)
    }
}

/// What a checkpoint has to agree with.
pub(super) fn identity(dataset: &Dataset, settings: &SlamSettings) -> Identity {
    // How much time there is, and how often the state is kept, may change from part to part.
    let time_budget = settings.time_budget.map(|_| Duration::ZERO);
    let decisive = SlamSettings { time_budget, checkpoint_interval: Duration::ZERO, ..*settings };
    Identity {
        program: Fingerprint::of(&(env!("CARGO_PKG_VERSION"), "slam", VERSION)),
        dataset: dataset_fingerprint(dataset),
        trajectory: Fingerprint::default(),
        settings: Fingerprint::of(&format!("{decisive:?}")),
        simd: Fingerprint::of_simd(dataset.simd()),
    }
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::{RigidTransform, so3};
    use nalgebra::Vector3;

    use super::*;

    fn some_pose(x: f64) -> RigidTransform {
        RigidTransform::new(so3::exp(&Vector3::new(0.1, x, -0.3)), Vector3::new(x, 1.0 / 3.0, -0.0))
    }

    #[test]
    fn instructions_come_back_bit_for_bit_and_empty_ones_are_not_kept() {
        let view = SharpView {
            rgb: vec![1, 2, 255],
            depth: vec![65_535],
            world_from_camera: some_pose(0.7),
            start_from: Some(some_pose(1e-9)),
        };
        let told = Instruction {
            world_move: Some(some_pose(-2.0)),
            reference: Some(view),
            ..Instruction::default()
        };
        let mut keeper = Keeper::new("nowhere".into(), Identity::default(), Duration::from_secs(20));
        keeper.note(3, &Instruction::default());
        keeper.note(7, &told);
        assert_eq!(keeper.instructions.len(), 1);
        let bytes = postcard::to_stdvec(&keeper.instructions).unwrap();
        let mut replay = Replay::new(
            (9, TrackerState::default()),
            postcard::from_bytes(&bytes).unwrap(),
            PathBuf::default(),
        );
        assert!(replay.take(3).reference.is_none());
        // Debug formatting of numbers tells all bits apart but those of NaN.
        assert_eq!(format!("{:?}", replay.take(7)), format!("{told:?}"));
        assert!(replay.take(7).reference.is_none(), "an instruction is followed once");
    }

    #[test]
    fn what_the_tracker_has_heard_of_is_not_kept() {
        let mut keeper = Keeper::new("nowhere".into(), Identity::default(), Duration::from_secs(20));
        let told = Instruction { world_move: Some(some_pose(1.0)), ..Instruction::default() };
        (0..100).for_each(|index| keeper.note(index, &told));
        let kept: Vec<usize> = keeper.instructions.iter().map(|(after, _)| *after).collect();
        // Frame 99 was tracked with what it was told after frame 97.
        assert_eq!(kept, [98, 99]);
        keeper.note(100, &Instruction::default());
        assert_eq!(keeper.instructions.len(), 1);
    }

    #[test]
    fn the_first_checkpoint_comes_soon_and_the_next_after_the_interval() {
        let keeper = |interval: f64| {
            let interval = Duration::from_secs_f64(interval);
            Keeper::new("nowhere".into(), Identity::default(), interval)
        };
        assert!(keeper(0.0).is_due());
        let mut waiting = keeper(20.0);
        assert!(!waiting.is_due());
        waiting.started = Instant::now().checked_sub(FIRST_AFTER).unwrap();
        assert!(waiting.is_due());
        waiting.saved = Some(Instant::now());
        assert!(!waiting.is_due());
    }
}
