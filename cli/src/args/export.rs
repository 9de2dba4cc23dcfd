//! Arguments of `mba export`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use mba_mapper::export::{ExportedImages, SceneLayout};

/// Arguments of `mba export`.
#[derive(Debug, Args)]
#[command(after_help = "\
Poses are those at mid exposure, in the world of the run, in metres. Lost frames are left out.

  tum         a file: timestamp tx ty tz qx qy qz qw, camera-to-world
  euroc       a file: nanoseconds, position and quaternion with w first, camera-to-world
  kitti       a folder: poses.txt with 3x4 matrices, camera-to-world, and times.txt
  splat       a file: the Gaussians of the map with colours for viewers, which blend display values
  nerfstudio  a folder: transforms.json (axes of OpenGL), images/, depth/ in millimetres, sparse_pc.ply
  colmap      a folder: sparse/0 with cameras, images (world-to-camera) and points3D, each as .txt and .bin, and images/

Images are undistorted, as the pinhole intrinsics of nerfstudio and colmap say; the centre of the first pixel is (0.5, 0.5) \
there. Keyframes are the deblurred ones where the run has them. Points are the centres of the Gaussians of the map, or \
come from depth where there is none. A file can be a pipe or device, and - is the standard output.

Examples:
  mba export run --to tum --out poses.txt
  mba export mapped --to splat --out scene.ply
  mba export mapped --to nerfstudio --out scene
  mba export mapped --to colmap --out model --images all --dataset data")]
pub struct Export {
    /// RUN folder that `mba track`, `mba map` or `mba slam` wrote
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Format to write
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub to: ExportFormat,
    /// File or folder to write; an earlier export is replaced
    #[arg(long, value_name = "PATH")]
    pub out: PathBuf,
    /// Write also over what this program did not write; never over a data set
    #[arg(long)]
    pub force: bool,
    /// Frames whose images are written, for nerfstudio and colmap; default: keyframes
    #[arg(long, value_enum)]
    pub images: Option<Images>,
    /// Data set of the run, if it has moved since
    #[arg(long, value_name = "DIR")]
    pub dataset: Option<PathBuf>,
}

/// Values of `--to`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    /// nerfstudio's transforms.json with images, depth and points
    Nerfstudio,
    /// Model of COLMAP as text and binary, with images
    Colmap,
    /// Poses of the KITTI odometry benchmark
    Kitti,
    /// Ground truth of the EuRoC MAV data set
    Euroc,
    /// Trajectory of the TUM RGB-D benchmark
    Tum,
    /// File of Gaussian splats that viewers show as the map looks
    Splat,
}

impl ExportFormat {
    /// The layout of a format with images.
    #[must_use]
    pub fn layout(self) -> Option<SceneLayout> {
        match self {
            Self::Nerfstudio => Some(SceneLayout::Nerfstudio),
            Self::Colmap => Some(SceneLayout::Colmap),
            Self::Kitti | Self::Euroc | Self::Tum | Self::Splat => None,
        }
    }
}

/// Values of `--images`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Images {
    /// Keyframes with a pose
    #[default]
    Keyframes,
    /// All frames with a pose
    All,
}

impl From<Images> for ExportedImages {
    fn from(images: Images) -> Self {
        match images {
            Images::Keyframes => Self::Keyframes,
            Images::All => Self::All,
        }
    }
}
