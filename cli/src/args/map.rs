//! Arguments of `mba map`.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use mba_mapper::map::MapKind;
use mba_mapper::mapping::MapSettings;

use super::submaps::JobWork;
use super::values::{BlurMode, positive_seconds, seconds};

/// Arguments of `mba map`.
#[derive(Debug, Args)]
#[command(after_help = "\
RUN2 gets map.ply, which opens in any viewer of Gaussian splats, or map.mbaf with the tri-plane field, deblurred/ \
and depth/ with a PNG per keyframe, and refined exposures of all frames in the files that `mba track` writes.

A run that was stopped, by a kill too, goes on with --resume and ends with the same files as one that was not.

Examples:
  mba track data --out run && mba map data --trajectory run --out mapped
  mba map data --trajectory run --out mapped --time-budget 120
  mba map job --submap 3
  mba map job --jobs 4")]
pub struct Map {
    /// Folder of the data set, or with --submap or --jobs of the job that `mba split` wrote
    #[arg(value_name = "DATASET|JOB")]
    pub dataset: PathBuf,
    /// RUN folder of the tracked data set
    #[arg(long, value_name = "RUN", required_unless_present_any = ["submap", "jobs"])]
    pub trajectory: Option<PathBuf>,
    /// RUN folder that is written
    #[arg(long, value_name = "RUN2", required_unless_present_any = ["submap", "jobs"])]
    pub out: Option<PathBuf>,
    /// Write also over what this program did not write; never over a data set
    #[arg(long)]
    pub force: bool,
    /// Go on from the checkpoint in RUN2, if there is one
    #[arg(long)]
    pub resume: bool,
    /// How the map is made.
    #[command(flatten)]
    pub mapping: Mapping,
    /// What of a job is mapped.
    #[command(flatten)]
    pub work: JobWork,
}

/// How a map is made.
#[derive(Clone, Copy, Debug, Args)]
pub struct Mapping {
    /// What the map consists of
    #[arg(long, value_enum, default_value_t)]
    pub field: Field,
    /// Time for all of it in seconds; default: as long as the schedule takes
    #[arg(long, value_name = "S", value_parser = positive_seconds)]
    pub time_budget: Option<Duration>,
    /// Model of the motion during the exposure
    #[arg(long, value_enum, default_value_t)]
    pub blur: BlurMode,
    /// Let no frame say anything about its neighbours: no repair of reversed, misplaced or lost frames, no prior of motion
    #[arg(long)]
    pub no_continuity: bool,
    /// At most this many virtual views per exposure
    #[arg(long, value_name = "N")]
    pub virtual_views: Option<NonZeroUsize>,
    /// At most this many keyframes; the other frames are fitted to the finished map
    #[arg(long, value_name = "N", default_value_t = default_keyframes())]
    pub max_keyframes: NonZeroUsize,
    /// At most this many Gaussians; default: a third of the pixels of an image, in a wide scene a tenth of those of all surfaces
    /// that the keyframes see, but no more than 160000
    #[arg(long, value_name = "N")]
    pub max_gaussians: Option<NonZeroUsize>,
    /// Seconds between two checkpoints; 0 for one after every step
    #[arg(long, value_name = "S", default_value = "20", value_parser = seconds)]
    pub checkpoint_interval: Duration,
    /// Seed of the order in which keyframes are visited
    #[arg(long, value_name = "N", default_value_t = MapSettings::default().seed)]
    pub seed: u64,
}

/// Values of `--field`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Field {
    /// 3D Gaussians
    #[default]
    Gaussians,
    /// A tri-plane field of signed distance and colour
    Triplane,
}

impl From<Field> for MapKind {
    fn from(field: Field) -> Self {
        match field {
            Field::Gaussians => Self::Gaussians,
            Field::Triplane => Self::Field,
        }
    }
}

impl From<&Mapping> for MapSettings {
    fn from(args: &Mapping) -> Self {
        Self {
            kind: args.field.into(),
            blur: args.blur == BlurMode::Auto,
            continuity: !args.no_continuity,
            virtual_views: args.virtual_views.map(NonZeroUsize::get),
            max_keyframes: args.max_keyframes.get(),
            max_gaussians: args.max_gaussians.map(NonZeroUsize::get),
            time_budget: args.time_budget,
            checkpoint_interval: args.checkpoint_interval,
            seed: args.seed,
        }
    }
}

impl Default for Mapping {
    fn default() -> Self {
        Self {
            field: Field::default(),
            time_budget: None,
            blur: BlurMode::default(),
            no_continuity: false,
            virtual_views: None,
            max_keyframes: default_keyframes(),
            max_gaussians: None,
            checkpoint_interval: MapSettings::default().checkpoint_interval,
            seed: MapSettings::default().seed,
        }
    }
}

fn default_keyframes() -> NonZeroUsize {
    NonZeroUsize::new(MapSettings::default().max_keyframes).unwrap_or(NonZeroUsize::MIN)
}
