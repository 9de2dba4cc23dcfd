//! The command line.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use mba_mapper::evaluation::{Alignment, DEFAULT_MAX_DT};
use mba_mapper::tracking::TrackingOptions;
use mba_tracker::ReferenceMode;
use mba_tracker::transfer::MAX_VIRTUAL_VIEWS;

/// Motion-blur-aware RGB-D tracking on a CPU.
#[derive(Debug, Parser)]
#[command(name = "mba", version, propagate_version = true, max_term_width = 100)]
pub struct Cli {
    /// Options of every command.
    #[command(flatten)]
    pub global: Global,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// Options of every command.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Options of every command")]
pub struct Global {
    /// Print figures as JSON on stdout
    #[arg(long, global = true)]
    pub json: bool,
    /// Worker threads; default: one per core. Results do not depend on it
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// No progress and no notes on stderr
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// More notes on stderr
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Show what a data set holds, lacks and what is odd about it
    Info(Info),
    /// Track a data set: camera poses at opening, middle and closing of the shutter of every frame
    Track(Track),
    /// Write report.html and charts into a RUN folder
    Report(Report),
    /// Measure an estimate against a reference
    #[command(subcommand)]
    Eval(EvalCommand),
}

/// Arguments of `mba info`.
#[derive(Debug, Args)]
#[command(after_help = "\
A data set is a folder in the layout of the TUM RGB-D benchmark: rgb.txt and depth.txt (or associations.txt), \
the images, calibration.toml (not needed for freiburg1 to 3) and, optionally, groundtruth.txt, \
groundtruth_exposure.txt and exposures.csv.

Example:
  mba info rgbd_dataset_freiburg1_rpy")]
pub struct Info {
    /// Folder of the data set
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
}

/// Arguments of `mba track`.
#[derive(Debug, Args)]
#[command(after_help = "\
RUN gets trajectory.txt (TUM lines at mid exposure), exposures.txt (poses at opening, middle and closing), \
frames.csv and summary.json. It is kept up to date while the run goes on.

Examples:
  mba track rgbd_dataset_freiburg1_rpy --out run
  mba track data --out run-without-blur --blur off")]
pub struct Track {
    /// Folder of the data set
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// RUN folder to write; an earlier run in it is replaced
    #[arg(long, value_name = "RUN")]
    pub out: PathBuf,
    /// Choices about the tracker
    #[command(flatten)]
    pub tracking: Tracking,
}

/// Choices about the tracker.
#[derive(Clone, Debug, Default, Args)]
pub struct Tracking {
    /// Model the motion during the exposure, or take every frame for sharp
    #[arg(long, value_enum, default_value_t)]
    pub blur: BlurMode,
    /// Virtual views per exposure, at the most; default: as many as the blur length asks for
    #[arg(long, value_name = "N", value_parser = virtual_views)]
    pub virtual_views: Option<usize>,
    /// Keyframes as they are, or deblurred with their own motion
    #[arg(long, value_enum, default_value_t)]
    pub reference: Reference,
    /// Use the depth map of each frame, or only that of the keyframe
    #[arg(long, value_enum, default_value_t)]
    pub depth_term: Switch,
}

/// Values of `--blur`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BlurMode {
    /// Virtual views along the motion, as many as the blur length asks for
    #[default]
    Auto,
    /// One view per frame
    Off,
}

/// Values of `--reference`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Reference {
    /// As captured
    Raw,
    /// Deblurred where that lowers the residual
    #[default]
    Deblurred,
}

/// On or off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// Yes
    #[default]
    On,
    /// No
    Off,
}

impl From<&Tracking> for TrackingOptions {
    fn from(args: &Tracking) -> Self {
        Self {
            blur: args.blur == BlurMode::Auto,
            virtual_views: args.virtual_views,
            reference: match args.reference {
                Reference::Raw => ReferenceMode::Raw,
                Reference::Deblurred => ReferenceMode::Deblurred,
            },
            depth_term: args.depth_term == Switch::On,
        }
    }
}

/// Arguments of `mba report`.
#[derive(Debug, Args)]
#[command(after_help = "\
The report is one HTML file without network access: charts, figures and settings of the run.

Example:
  mba report run")]
pub struct Report {
    /// RUN folder that `mba track` wrote
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Data set with the ground truth, if it has moved since the run
    #[arg(long, value_name = "DIR")]
    pub dataset: Option<PathBuf>,
}

/// What to measure.
#[derive(Debug, Subcommand)]
pub enum EvalCommand {
    /// Trajectory errors (ATE, RPE) as the evo package defines them, and blur figures
    Trajectory(EvalTrajectory),
}

/// Arguments of `mba eval trajectory`.
#[derive(Debug, Args)]
#[command(after_help = "\
Files are TUM trajectories (timestamp tx ty tz qx qy qz qw) or exposures.txt files (timestamp, then the \
pose at opening, middle and closing of the shutter). With two exposures files and --dataset the blur \
figures are printed too.

Examples:
  mba eval trajectory --reference data/groundtruth.txt --estimate run/trajectory.txt
  mba eval trajectory --reference data/groundtruth_exposure.txt --estimate run/exposures.txt --dataset data")]
pub struct EvalTrajectory {
    /// True trajectory or true exposures
    #[arg(long, value_name = "FILE")]
    pub reference: PathBuf,
    /// Estimated trajectory or exposures
    #[arg(long, value_name = "FILE")]
    pub estimate: PathBuf,
    /// Freedom given to the estimate before it is compared
    #[arg(long, value_enum, default_value_t)]
    pub align: AlignMode,
    /// Largest time difference of a matched pair, in seconds
    #[arg(long, value_name = "S", default_value_t = DEFAULT_MAX_DT, value_parser = non_negative)]
    pub max_dt: f64,
    /// Data set of the exposures: its calibration and median depth turn motions into blur lengths
    #[arg(long, value_name = "DIR")]
    pub dataset: Option<PathBuf>,
}

/// Names of [`Alignment`] on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum AlignMode {
    /// Rotation and translation
    #[default]
    Se3,
    /// Rotation, translation and scale
    Sim3,
    /// As it is
    None,
}

impl From<AlignMode> for Alignment {
    fn from(mode: AlignMode) -> Self {
        match mode {
            AlignMode::Se3 => Self::Se3,
            AlignMode::Sim3 => Self::Sim3,
            AlignMode::None => Self::None,
        }
    }
}

/// A finite number that is not negative.
fn non_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("a number that is not negative is needed".to_owned()),
    }
}

/// A number of virtual views that the tracker has room for.
fn virtual_views(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(views) if (1..=MAX_VIRTUAL_VIEWS).contains(&views) => Ok(views),
        _ => Err(format!("a number from 1 to {MAX_VIRTUAL_VIEWS} is needed")),
    }
}
