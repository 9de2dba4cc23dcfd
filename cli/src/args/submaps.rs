//! Arguments of `mba split`, `mba status` and `mba merge`.

use std::num::{NonZeroU16, NonZeroUsize};
use std::path::PathBuf;

use clap::Args;
use mba_mapper::mapping::MapSettings;
use mba_mapper::submaps::{GroupLimits, PlanSettings, SplitSettings};

use super::values::{BlurMode, non_negative};

/// Share of the most keyframes of a group that it has at least.
const LEAST: f64 = 0.6;

/// Arguments of `mba split`.
#[derive(Debug, Args)]
#[command(after_help = "\
A run of any length is cut along its path into groups of keyframes, each closed when the camera has gone far, turned \
much or left what it saw at first. Every group is mapped with a border: keyframes before and behind it, and those of \
other groups that see the same. JOB gets submaps.json; `mba map JOB --submap K` maps group K into JOB/00K, in any \
order and on any machine, and `mba merge JOB` makes one run of them.

Examples:
  mba split run --out job
  mba split run --out job --group-keyframes 40")]
pub struct Split {
    /// RUN folder that `mba track` or `mba slam` wrote
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Folder of the job; an earlier job in it is replaced
    #[arg(long, value_name = "JOB")]
    pub out: PathBuf,
    /// Folder of the data set, if it has moved since the run
    #[arg(long, value_name = "DIR")]
    pub dataset: Option<PathBuf>,
    /// Write also over what this program did not write; never over a data set
    #[arg(long)]
    pub force: bool,
    /// Keyframes of a group at the most, its border aside; at least 4. A group has at least 60 % of them
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u16).range(4..=1000))]
    pub group_keyframes: u16,
    /// Movement of the picture from keyframe to keyframe as a share of its width; 0: all frames are keyframes
    #[arg(long, value_name = "SHARE", default_value_t = 0.04, value_parser = non_negative)]
    pub keyframe_motion: f64,
    /// Model of the motion during the exposure
    #[arg(long, value_enum, default_value_t)]
    pub blur: BlurMode,
    /// Let no frame say anything about its neighbours: no repair of reversed, misplaced or lost frames, no prior of motion
    #[arg(long)]
    pub no_continuity: bool,
    /// At most this many virtual views per exposure
    #[arg(long, value_name = "N")]
    pub virtual_views: Option<NonZeroUsize>,
    /// At most this many Gaussians in a group; default: a sixth of the pixels of all that it sees
    #[arg(long, value_name = "N")]
    pub max_gaussians: Option<NonZeroUsize>,
    /// Seed of the order in which keyframes are visited
    #[arg(long, value_name = "N", default_value_t = MapSettings::default().seed)]
    pub seed: u64,
}

impl From<&Split> for SplitSettings {
    fn from(args: &Split) -> Self {
        let most = usize::from(args.group_keyframes);
        Self {
            keyframe_motion: args.keyframe_motion,
            limits: GroupLimits { least: (LEAST * most as f64).ceil() as usize, most },
            mapping: PlanSettings {
                blur: args.blur == BlurMode::Auto,
                continuity: !args.no_continuity,
                virtual_views: args.virtual_views.map(NonZeroUsize::get),
                seed: args.seed,
            },
            max_gaussians: args.max_gaussians.map(NonZeroUsize::get),
        }
    }
}

/// What of a job `mba map` works on.
#[derive(Clone, Copy, Debug, Default, Args)]
#[command(next_help_heading = "Groups of a job that `mba split` wrote")]
pub struct JobWork {
    /// Map this group of the job, counted from 0, unless it is mapped already. A group that was stopped goes on; exit code 75:
    /// stopped by a signal, try again
    #[arg(long, value_name = "K", conflicts_with_all = WHOLE)]
    pub submap: Option<usize>,
    /// Map all groups of the job that are not mapped yet, this many at a time in processes of their own, or as many as fit
    /// into memory
    #[arg(long, value_name = "N", conflicts_with = "submap", conflicts_with_all = WHOLE)]
    pub jobs: Option<NonZeroU16>,
}

/// Options of a map of a whole data set, which a job has in its plan.
const WHOLE: [&str; 12] = [
    "trajectory",
    "out",
    "force",
    "resume",
    "field",
    "time_budget",
    "blur",
    "no_continuity",
    "virtual_views",
    "max_keyframes",
    "max_gaussians",
    "seed",
];

/// Arguments of `mba status`.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  mba status job --json")]
pub struct Status {
    /// Folder that `mba split` wrote
    #[arg(value_name = "JOB")]
    pub job: PathBuf,
}

/// Arguments of `mba merge`.
#[derive(Debug, Args)]
#[command(after_help = "\
The worlds of the groups are moved to agree on the keyframes that they share, their light is made one, and every \
Gaussian stays in the group only whose keyframe sees it nearest and most frontally. RUN has what `mba map` writes. \
The result does not depend on the order in which the groups were mapped.

Example:
  mba merge job --out mapped")]
pub struct Merge {
    /// Folder that `mba split` wrote, its groups mapped
    #[arg(value_name = "JOB")]
    pub job: PathBuf,
    /// RUN folder that is written
    #[arg(long, value_name = "RUN")]
    pub out: PathBuf,
    /// Leave out groups that are not mapped: their frames keep the poses of the run that was split
    #[arg(long)]
    pub without_missing: bool,
    /// Write also over what this program did not write; never over a data set
    #[arg(long)]
    pub force: bool,
}
