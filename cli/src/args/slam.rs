//! Arguments of `mba slam` and `mba ablate`.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use mba_mapper::slam::{Arrival, SlamReference, SlamSettings};
use nalgebra::UnitVector3;

use super::map::Field;
use super::values::{BlurMode, Switch, direction, positive_seconds, seconds, virtual_views};

/// Arguments of `mba slam`.
#[derive(Debug, Args)]
#[command(after_help = "\
Tracker and mapper work at the same time: each frame is aligned with a sharp view rendered from the map, and the \
map is refined with every frame. After the last frame all of it is refined once more. RUN gets what `mba map` \
writes; its trajectory is kept up to date while frames come in, so that a stopped run can be evaluated. Without \
--realtime, a run that was stopped, by a kill too, goes on with --resume and ends with the same files as one that was not.

Examples:
  mba slam rgbd_dataset_freiburg1_rpy --out run
  mba slam data --out live --realtime --time-budget 10")]
pub struct Slam {
    /// Folder of the data set
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// RUN folder to write; an earlier run in it is replaced
    #[arg(long, value_name = "RUN")]
    pub out: PathBuf,
    /// Write also over what this program did not write; never over a data set
    #[arg(long)]
    pub force: bool,
    /// Go on from the checkpoint in RUN, if there is one
    #[arg(long, conflicts_with = "realtime")]
    pub resume: bool,
    /// How it is done.
    #[command(flatten)]
    pub slamming: Slamming,
}

/// Arguments of `mba ablate`.
#[derive(Debug, Args)]
#[command(after_help = "\
Runs `mba slam` or `mba track` with defaults, then once more with each part left out or replaced, and prints a table. DIR \
gets one RUN folder per run; runs whose folder is complete are not run again. Without ground truth the tracker's table still \
says how many motions within exposures cannot be.

Examples:
  mba ablate data --out ablation
  mba ablate data --out parts --of track --repeats 5")]
pub struct Ablate {
    /// Folder of the data set, best with ground truth
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// Folder for the runs
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// What is run: all of slam, or the tracker alone, which takes seconds
    #[arg(long, value_enum, default_value_t)]
    pub of: Ablated,
    /// Runs of each row, with focal lengths that differ by a ten-thousandth: what a figure varies by itself is no worth of any
    /// part. The table has the middle of the runs, the least and the most
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=99))]
    pub repeats: u16,
}

/// Values of `ablate --of`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Ablated {
    /// Tracking and mapping at the same time
    #[default]
    Slam,
    /// The tracker alone: blur model, rows, depth term, deblurred keyframes, IMU
    Track,
}

/// How SLAM is done.
#[derive(Clone, Copy, Debug, Args)]
pub struct Slamming {
    /// What the map consists of
    #[arg(long, value_enum, default_value_t)]
    pub field: Field,
    /// Frames arrive by their timestamps; those that come too late for the tracker are skipped. Default: tracker and
    /// mapper in lock step, as fast as they can, with the same result every time
    #[arg(long)]
    pub realtime: bool,
    /// Seconds for the refinement after the last frame; default: as long as the number of keyframes asks for
    #[arg(long, value_name = "S", value_parser = positive_seconds)]
    pub time_budget: Option<Duration>,
    /// At most this many keyframes at a time
    #[arg(long, value_name = "N", default_value_t = default_keyframes())]
    pub max_keyframes: NonZeroUsize,
    /// At most this many Gaussians; default: a third of the pixels that showed something new
    #[arg(long, value_name = "N")]
    pub max_gaussians: Option<NonZeroUsize>,
    /// Seconds between two checkpoints, without --realtime; 0 for one after every frame and step
    #[arg(long, value_name = "S", default_value = "20", value_parser = seconds)]
    pub checkpoint_interval: Duration,
    /// Seed of the choice of keyframes to visit
    #[arg(long, value_name = "N", default_value_t = SlamSettings::default().seed)]
    pub seed: u64,
    /// Find exposure and readout times that are not on record from the recording first, or assume the usual
    #[arg(long, value_enum, default_value_t)]
    pub self_calibrate: Switch,
    /// Where up is in the first camera's axes (x right, y down, z ahead): -y for one that was held upright. The world then
    /// has z up; default: by an accelerometer, else the world is the first camera's
    #[arg(long, value_name = "AXIS", value_parser = direction, allow_hyphen_values = true)]
    pub up: Option<UnitVector3<f64>>,
    /// What can be left out.
    #[command(flatten)]
    pub ablation: Ablation,
}

/// What can be left out or replaced, to see what it is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Args)]
#[command(next_help_heading = "Ablation: leave a part out to see what it is worth")]
pub struct Ablation {
    /// Model the motion during the exposure, or take every frame for sharp
    #[arg(long, value_enum, default_value_t)]
    pub blur: BlurMode,
    /// Virtual views per exposure, at the most; default: as many as the blur length asks for
    #[arg(long, value_name = "N", value_parser = virtual_views)]
    pub virtual_views: Option<usize>,
    /// What frames are aligned with: keyframes as captured or deblurred, or views of the map
    #[arg(long, value_enum, default_value_t)]
    pub reference: MapReference,
    /// Use the depth map of each frame, or only that of the reference
    #[arg(long, value_enum, default_value_t)]
    pub depth_term: Switch,
    /// Correct the drift when a place is seen again
    #[arg(long = "loop", value_enum, default_value_t)]
    pub loops: Switch,
    /// Let no frame say anything about its neighbours in the refinement: no repair of reversed, misplaced or lost frames,
    /// no prior of motion
    #[arg(long)]
    pub no_continuity: bool,
}

/// Values of `--reference`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum MapReference {
    /// Keyframes as captured
    Raw,
    /// Keyframes deblurred with their own motion
    Deblurred,
    /// Views of the map; deblurred keyframes while it is young
    #[default]
    Map,
}

impl From<&Slamming> for SlamSettings {
    fn from(args: &Slamming) -> Self {
        let Ablation { blur, virtual_views, reference, depth_term, loops, no_continuity } = args.ablation;
        Self {
            kind: args.field.into(),
            blur: blur == BlurMode::Auto,
            virtual_views,
            reference: match reference {
                MapReference::Raw => SlamReference::Raw,
                MapReference::Deblurred => SlamReference::Deblurred,
                MapReference::Map => SlamReference::Map,
            },
            depth_term: depth_term == Switch::On,
            loops: loops == Switch::On,
            continuity: !no_continuity,
            max_keyframes: args.max_keyframes.get(),
            max_gaussians: args.max_gaussians.map(NonZeroUsize::get),
            time_budget: args.time_budget,
            checkpoint_interval: args.checkpoint_interval,
            arrival: if args.realtime { Arrival::RealTime } else { Arrival::LockStep },
            seed: args.seed,
            up: args.up,
        }
    }
}

impl Default for Slamming {
    fn default() -> Self {
        Self {
            field: Field::default(),
            realtime: false,
            time_budget: None,
            max_keyframes: default_keyframes(),
            max_gaussians: None,
            checkpoint_interval: SlamSettings::default().checkpoint_interval,
            seed: SlamSettings::default().seed,
            self_calibrate: Switch::default(),
            up: None,
            ablation: Ablation::default(),
        }
    }
}

fn default_keyframes() -> NonZeroUsize {
    NonZeroUsize::new(SlamSettings::default().max_keyframes).unwrap_or(NonZeroUsize::MIN)
}
