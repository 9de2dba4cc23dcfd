//! The command line.

pub mod bench;
pub mod export;
pub mod import;
pub mod localise;
pub mod map;
pub mod shell;
pub mod slam;
pub mod submaps;
pub mod surface;
pub mod synth;
mod values;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use mba_mapper::evaluation::{DEFAULT_MAX_DT, TrajectoryAlignment};
use mba_mapper::tracking::TrackingOptions;
use mba_tracker::ReferenceMode;
use nalgebra::UnitVector3;

pub use values::{BlurMode, LengthBetween, Switch};
use values::{direction, length_between, non_negative, positive, seconds, size, virtual_views};

/// Most worker threads: several for every core of the largest machines.
pub const MOST_THREADS: u16 = 1024;

/// Motion-blur-aware RGB-D tracking and mapping on a CPU.
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
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST_THREADS)))]
    pub threads: Option<u16>,
    /// SIMD level to compute with: sse2, sse4.2, avx2, avx512 or neon; default: the best of this machine. Results of two levels
    /// differ in their last digits
    #[arg(long, global = true, value_name = "LEVEL")]
    pub simd: Option<String>,
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
    /// Render a blurred sequence, track and map it, and show how well that went; needs no input
    Demo(Demo),
    /// Render a synthetic, motion-blurred RGB-D data set with exact ground truth
    Synth(synth::Synth),
    /// Write a recording of another program or camera as a data set
    Import(import::Import),
    /// Show what a data set holds, lacks and what is odd about it
    Info(Info),
    /// Find what is not on record about the camera from the recording itself
    Calibrate(Calibrate),
    /// Track a data set: camera poses at opening, middle and closing of the shutter of every frame
    Track(Track),
    /// Make a sharp map of a tracked data set, refine all exposures and deblur keyframes
    Map(map::Map),
    /// Track and map a data set at the same time
    Slam(slam::Slam),
    /// Run slam with each part left out in turn and print what it is worth
    Ablate(slam::Ablate),
    /// Run the sequences of a benchmark and print what has been published of them beside
    Bench(bench::Bench),
    /// Split a tracked run of any length into groups that are mapped one by one, on one machine or many
    Split(submaps::Split),
    /// Show how far the groups of a split run are
    Status(submaps::Status),
    /// Make one run with one map of the groups of a split run
    Merge(submaps::Merge),
    /// Find the frames of another recording in the map of a RUN folder
    Localise(localise::Localise),
    /// Render views of the map of a RUN folder from given poses
    Render(Render),
    /// Write the surface of the map of a RUN folder as a coloured mesh
    Mesh(surface::MeshArgs),
    /// Write a RUN folder in the format of another program: nerfstudio, COLMAP, splats, KITTI, EuRoC, TUM
    Export(export::Export),
    /// Write report.html, charts and pictures into a RUN folder
    Report(Report),
    /// Walk through the map of a RUN folder in a browser
    View(View),
    /// Measure an estimate against a reference
    #[command(subcommand)]
    Eval(EvalCommand),
    /// Print what lets a shell complete commands and options
    Completions(shell::Completions),
    /// Print or write man pages
    Man(shell::Man),
}

/// Arguments of `mba demo`.
#[derive(Debug, Args)]
#[command(after_help = "\
The folder gets the sequence (kept for the next time), a RUN folder as `mba track` writes it, and one as \
`mba map` does, with charts, pictures and report.html.

Example:
  mba demo --quick")]
pub struct Demo {
    /// Folder for everything that is written
    #[arg(long, value_name = "DIR", default_value = "mba-demo")]
    pub out: PathBuf,
    /// Fewer and smaller frames
    #[arg(long)]
    pub quick: bool,
}

/// Arguments of `mba info`.
#[derive(Debug, Args)]
#[command(after_help = "\
A data set is a folder in the layout of the TUM RGB-D benchmark: rgb.txt and depth.txt (or associations.txt), \
the images, calibration.toml (not needed for freiburg1 to 3) and, optionally, groundtruth.txt, \
groundtruth_exposure.txt, exposures.csv and the recording of an IMU: imu.csv, imu0/data.csv (EuRoC) or \
accelerometer.txt (TUM). What is printed says of exposure, readout, response and fall-off whether they are \
recorded or assumed.

Exit code 2 says that nothing can be read, 1 that nothing in the images can be tracked: black, of one colour, without depth.

Example:
  mba info rgbd_dataset_freiburg1_rpy")]
pub struct Info {
    /// Folder of the data set
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
}

/// Arguments of `mba calibrate`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exposure and readout times that are not on record are estimated, each with a standard deviation; what the recording \
cannot tell is said to be unknown. FILE is a calibration.toml with what was found; exposure times of single frames go \
beside it, into exposures.csv for a FILE of that name.

Examples:
  mba calibrate data
  mba calibrate data --focal-length --out found/calibration.toml
  mba calibrate data --distance 0:250=1.2 --out found/calibration.toml")]
pub struct Calibrate {
    /// Folder of the data set
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// Calibration to write; default: only print
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Look for the focal length, too, around the one on record
    #[arg(long)]
    pub focal_length: bool,
    /// A length that was measured, which fixes the depth scale: the camera was this many metres further at frame TO than at
    /// frame FROM, in a straight line; frames count from 0
    #[arg(long, value_name = "FROM:TO=METRES", value_parser = length_between)]
    pub distance: Option<LengthBetween>,
}

/// Arguments of `mba track`.
#[derive(Debug, Args)]
#[command(after_help = "\
RUN gets trajectory.txt (TUM lines at mid exposure), exposures.txt (poses at opening, middle and closing), \
frames.csv, summary.json, covariances.txt (6x6, of every pose) and deblurred/, the keyframes without their blur. It is kept up to date while the \
run goes on. A run that was stopped, by a kill too, goes on with --resume and ends with the same files as one that was not.

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
    /// Write also over what this program did not write; never over a data set
    #[arg(long)]
    pub force: bool,
    /// Go on from the checkpoint in RUN, if there is one
    #[arg(long)]
    pub resume: bool,
    /// Seconds between two checkpoints; 0 for one after every frame
    #[arg(long, value_name = "S", default_value = "20", value_parser = seconds)]
    pub checkpoint_interval: Duration,
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
    /// Track frames that are blurred, or whose rows are exposed one after the other, once more, from the last to the first, and
    /// join what both ways measured; takes as long again
    #[arg(long, value_enum, default_value_t)]
    pub hindsight: Switch,
    /// Write the deblurred image of every keyframe, after the last frame
    #[arg(long, value_enum, default_value_t)]
    pub keyframes: Switch,
    /// Find exposure and readout times that are not on record from the recording first, or assume the usual
    #[arg(long, value_enum, default_value_t)]
    pub self_calibrate: Switch,
    /// Where up is in the first camera's axes (x right, y down, z ahead): -y for one that was held upright. The world then
    /// has z up; default: by an accelerometer, else the world is the first camera's
    #[arg(long, value_name = "AXIS", value_parser = direction, allow_hyphen_values = true)]
    pub up: Option<UnitVector3<f64>>,
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

/// Arguments of `mba render`.
#[derive(Debug, Args)]
#[command(after_help = "\
Poses are TUM lines, camera-to-world: timestamp tx ty tz qx qy qz qw. DIR gets NNNNNN.png, colours with the \
response of the data set's camera, and depth/NNNNNN.png, 16 bit, 0 where the map is not solid. They are named by \
the line in the file of poses, from 000000.

A run has a world of its own, that of its first frame. With --align, the run's trajectory is aligned with FILE by \
positions and orientations, and the poses may be in the frame of FILE.

Examples:
  mba render run --poses run/trajectory.txt --out views
  mba render run --poses data/heldout_views/poses.txt --align data/groundtruth.txt --out views")]
pub struct Render {
    /// RUN folder with a map
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Poses to render from
    #[arg(long, value_name = "FILE")]
    pub poses: PathBuf,
    /// Folder for the images; earlier views in it are replaced
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write also over what this program did not write; never over a data set
    #[arg(long)]
    pub force: bool,
    /// Trajectory of the run's frames in the frame of the poses, e.g. the ground truth
    #[arg(long, value_name = "FILE")]
    pub align: Option<PathBuf>,
    /// Largest time difference of frames matched for --align, in seconds
    #[arg(long, value_name = "S", default_value_t = DEFAULT_MAX_DT, value_parser = non_negative)]
    pub max_dt: f64,
    /// Width and height of the images in pixels, same field of view; default: those of the data set
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<(usize, usize)>,
    /// Focal length in pixels, with the principal point in the middle; default: the camera of the data set
    #[arg(long, value_name = "PX", value_parser = non_negative)]
    pub focal: Option<f64>,
    /// Colours from the surroundings where the map has nothing, or black
    #[arg(long, value_enum, default_value_t)]
    pub fill: Switch,
    /// What the images are named by
    #[arg(long, value_enum, default_value_t)]
    pub names: ViewNames,
}

/// Values of `--names`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ViewNames {
    /// Number of the pose in its file, from 000000
    #[default]
    Line,
    /// Timestamp of the pose with six decimals
    Timestamp,
}

/// Arguments of `mba report`.
#[derive(Debug, Args)]
#[command(after_help = "\
The report is one HTML file without network access: the map to walk through, charts, figures and settings of the run. The charts are in \
plots/ as well, and pictures/ gets the most blurred keyframes, captured, deblurred and true side by side with the \
estimated motion drawn into the captured one, a detail of each, and views of the map.

Example:
  mba report run")]
pub struct Report {
    /// RUN folder that `mba track` or `mba map` wrote
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Data set with the ground truth, if it has moved since the run
    #[arg(long, value_name = "DIR")]
    pub dataset: Option<PathBuf>,
    /// Write also over files that this program did not write
    #[arg(long)]
    pub force: bool,
}

/// Arguments of `mba view`.
#[derive(Debug, Args)]
#[command(after_help = "\
RUN gets view.html, one file without network access that any browser of today shows: the map, the path of the camera with \
every exposure as an arc, and the keyframes, captured and deblurred. `mba report` has the same in its page. An address \
that ends in #frame=12 starts at that keyframe.

Examples:
  mba view mapped
  mba view mapped --no-open")]
pub struct View {
    /// RUN folder with a map of Gaussians
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Data set of the run, if it has moved since
    #[arg(long, value_name = "DIR")]
    pub dataset: Option<PathBuf>,
    /// Write the page without opening it
    #[arg(long)]
    pub no_open: bool,
    /// Write also over a file that this program did not write
    #[arg(long)]
    pub force: bool,
}

/// What to measure.
#[derive(Debug, Subcommand)]
pub enum EvalCommand {
    /// Trajectory errors (ATE, RPE) as the evo package defines them, and blur figures
    Trajectory(EvalTrajectory),
    /// PSNR and SSIM of images, and differences of depth maps, against true ones of the same name
    Images(EvalImages),
    /// Precision, recall and F1 of a surface against a true one
    Mesh(surface::EvalMesh),
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

/// Arguments of `mba eval images`.
#[derive(Debug, Args)]
#[command(after_help = "\
Images are paired by their names without extension; .png and .jpg are read. Colour images get PSNR and SSIM \
(of display values, as published figures are), 16-bit images with one channel are depth maps and get the mean \
absolute difference where both have depth. With --captured the frame of the data set that has the number in \
the image's name is compared with the reference too, which shows what deblurring gained. In JSON the PSNR of \
equal images is null.

Examples:
  mba eval images --reference data/sharp --estimate run/deblurred --captured data
  mba eval images --reference data/depth --estimate run/depth --depth-scale 5000")]
pub struct EvalImages {
    /// Folder of the true images
    #[arg(long, value_name = "DIR")]
    pub reference: PathBuf,
    /// Folder of the images to judge
    #[arg(long, value_name = "DIR")]
    pub estimate: PathBuf,
    /// Data set of the captured frames, if images are named by the index of their frame
    #[arg(long, value_name = "DATASET")]
    pub captured: Option<PathBuf>,
    /// Raw units per metre of depth maps; 0 is missing
    #[arg(long, value_name = "UNITS", default_value_t = 5000.0, value_parser = positive)]
    pub depth_scale: f64,
}

/// Names of [`TrajectoryAlignment`] on the command line.
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

impl From<AlignMode> for TrajectoryAlignment {
    fn from(mode: AlignMode) -> Self {
        match mode {
            AlignMode::Se3 => Self::Se3,
            AlignMode::Sim3 => Self::Sim3,
            AlignMode::None => Self::None,
        }
    }
}
