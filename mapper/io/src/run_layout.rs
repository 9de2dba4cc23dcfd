//! What a RUN folder looks like from outside: names of files, and how one is recognised.

use std::path::{Path, PathBuf};

use crate::whole_file::read_text;

/// Name of the trajectory at mid exposure.
pub const TRAJECTORY_FILE: &str = "trajectory.txt";
/// Name of the poses at opening, middle and closing of the shutter.
pub const EXPOSURES_FILE: &str = "exposures.txt";
/// Name of the covariances of the poses at mid exposure.
pub const COVARIANCES_FILE: &str = "covariances.txt";
/// Name of the table of frames.
pub const FRAMES_FILE: &str = "frames.csv";
/// Name of the summary.
pub const SUMMARY_FILE: &str = "summary.json";
/// Name of what a run that was stopped goes on from.
pub const CHECKPOINT_FILE: &str = "checkpoint";

/// Name of the folder of deblurred keyframes.
pub const DEBLURRED_FOLDER: &str = "deblurred";

/// Name of the folder of the keyframes' depth maps, 16 bit in the units of the data set.
pub const DEPTH_FOLDER: &str = "depth";

/// Name of the plan of a run that was split, in the folder of the job.
pub const SUBMAPS_FILE: &str = "submaps.json";

/// Name of what the map of one group says of itself, in its RUN folder.
pub const SUBMAP_FILE: &str = "submap.json";

/// Where a run in `folder` keeps the deblurred image of keyframe `index`, the index of the frame in the data set.
#[must_use]
pub fn deblurred_path(folder: &Path, index: usize) -> PathBuf {
    folder.join(DEBLURRED_FOLDER).join(format!("{index:06}.png"))
}

/// Whether a command wrote `folder`: its summary has the form of one, whatever the version.
pub(crate) fn is_run(folder: &Path) -> bool {
    let text = read_text(&folder.join(SUMMARY_FILE)).unwrap_or_default();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    summary["format"].is_u64()
        && summary["complete"].is_boolean()
        && summary["program"].is_string()
        && summary["frames"].is_object()
}

/// Whether a command wrote `folder` as a job: its plan has the form of one, whatever the version.
pub(crate) fn is_job(folder: &Path) -> bool {
    let text = read_text(&folder.join(SUBMAPS_FILE)).unwrap_or_default();
    let plan: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    plan["format"].is_u64() && plan["program"].is_string() && plan["groups"].is_array()
}
