//! From the world of a run to that of another trajectory, for commands with `--align`.

use std::path::Path;

use mba_mapper::evaluation::{PoseAlignment, align_poses};
use mba_mapper::run::{FrameStatus, Run, mid_pose};
use mba_mapper::trajectory_file::{TimedPose, read_trajectory};
use serde::Serialize;

use crate::failure::OrBadInput;

/// How well the trajectory of the run agrees with the file of `--align`.
#[derive(Clone, Debug, Serialize)]
pub struct AlignmentFigures {
    /// Frames that are in both.
    pub matches: usize,
    /// Root mean square of the angles that are left.
    pub rotation_rms_deg: f64,
    /// Root mean square of the distances that are left.
    pub translation_rms_m: f64,
}

/// Aligns the frames of the run that were not lost with the trajectory in `file`.
///
/// # Errors
/// Bad input when the file cannot be read or has nothing in common with the run.
pub fn align(run: &Run, file: &Path, max_dt: f64) -> anyhow::Result<PoseAlignment> {
    let reference =
        read_trajectory(file).or_bad_input("--align needs lines `timestamp tx ty tz qx qy qz qw`")?;
    let frames = run.exposures.iter().zip(&run.frames);
    let tracked: Vec<TimedPose> = frames
        .filter(|(_, record)| record.status != FrameStatus::Lost)
        .map(|(exposure, _)| mid_pose(exposure))
        .collect();
    align_poses(&reference, &tracked, max_dt).or_bad_content(
        file,
        "--align needs a trajectory of the same recording; --max-dt is the time difference allowed",
    )
}

impl AlignmentFigures {
    /// The row of a table.
    #[must_use]
    pub fn row(&self) -> (&'static str, String) {
        let Self { matches, rotation_rms_deg, translation_rms_m } = self;
        let left = format!(
            "{matches} frames, {rotation_rms_deg:.2} deg and {:.2} cm left (RMS)",
            100.0 * translation_rms_m
        );
        ("aligned", left)
    }
}

impl From<&PoseAlignment> for AlignmentFigures {
    fn from(alignment: &PoseAlignment) -> Self {
        Self {
            matches: alignment.matches,
            rotation_rms_deg: alignment.rotation_rms.to_degrees(),
            translation_rms_m: alignment.translation_rms,
        }
    }
}
