//! Arguments of `mba mesh` and `mba eval mesh`.

use std::path::PathBuf;

use clap::Args;
use mba_mapper::evaluation::DEFAULT_MAX_DT;

use super::values::{non_negative, positive};

/// Arguments of `mba mesh`.
#[derive(Debug, Args)]
#[command(after_help = "\
The map is rendered from the keyframes of the run. From Gaussians, the depth of all views is fused into one surface; \
that of a field is where its signed distance is zero. Only what a keyframe sees is kept. FILE has colours of vertices, in metres; its ending tells the format: .ply, .glb \
(binary glTF 2.0) or .obj.

A run has a world of its own, that of its first frame. With --align, the run's trajectory is aligned with another \
one by positions and orientations, and the mesh is in the frame of that. In a run's own world y points down, and a GLB, which \
is y-up, is turned to stand upright; with --align it keeps the axes of the other trajectory.

Examples:
  mba mesh mapped --out mesh.glb --faces 50000
  mba mesh mapped --out mesh.ply --voxel-cm 0.5 --align data/groundtruth.txt")]
pub struct MeshArgs {
    /// RUN folder with a map
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// File to write (.ply, .glb, .obj); an earlier mesh is replaced. A pipe or device is written to, and - is the standard output
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Write also over what this program did not write; never over a data set
    #[arg(long)]
    pub force: bool,
    /// Edge of a voxel in centimetres
    #[arg(long, value_name = "CM", default_value_t = 1.0, value_parser = positive)]
    pub voxel_cm: f64,
    /// Parts that hang together with nothing else are left out below this area, in square centimetres
    #[arg(long, value_name = "CM2", default_value_t = 100.0, value_parser = non_negative)]
    pub least_area_cm2: f64,
    /// At most so many triangles: edges are collapsed where that changes the surface least. Default: all
    #[arg(long, value_name = "N")]
    pub faces: Option<u32>,
    /// Trajectory of the run's frames in the frame that the mesh shall have, e.g. the ground truth
    #[arg(long, value_name = "TRAJECTORY")]
    pub align: Option<PathBuf>,
    /// Largest time difference of frames matched for --align, in seconds
    #[arg(long, value_name = "S", default_value_t = DEFAULT_MAX_DT, value_parser = non_negative)]
    pub max_dt: f64,
}

/// Arguments of `mba eval mesh`.
#[derive(Debug, Args)]
#[command(after_help = "\
Files are PLY meshes, which are sampled evenly by area, or clouds of points, which are taken as they are. Precision is \
the share of the estimate that is within the threshold of the reference, recall the share of the reference that is \
within the threshold of the estimate, F1 their harmonic mean; accuracy and completion are the distances behind them.

Both files have to be in one frame: `mba mesh --align` writes such meshes. For others, --align moves the estimate from \
the world of a run to that of a trajectory of the same frames.

Depth L1 is what cameras see of the difference: with --views, depth images of both meshes (320x240 pixels, 60 degrees \
wide) are made from up to 100 poses, evenly chosen from a trajectory in the frame of the reference. It is the mean \
absolute difference over the pixels where both have a surface; the share of the reference's pixels where the estimate \
has one is printed with it. Both files need triangles for that.

Examples:
  mba eval mesh --reference scene.ply --estimate mesh.ply --views data/groundtruth.txt
  mba eval mesh --reference data/surface_points.ply --estimate mesh.ply --threshold-cm 1,2,5
  mba eval mesh --reference data/surface_points.ply --estimate mesh.ply --align data/groundtruth.txt --trajectory run")]
pub struct EvalMesh {
    /// True surface
    #[arg(long, value_name = "FILE")]
    pub reference: PathBuf,
    /// Surface to judge
    #[arg(long, value_name = "FILE")]
    pub estimate: PathBuf,
    /// Distances that count as equal, in centimetres
    #[arg(long, value_name = "CM", default_value = "1", value_delimiter = ',', value_parser = positive)]
    pub threshold_cm: Vec<f64>,
    /// Trajectory of the run's frames in the frame of the reference, e.g. the ground truth
    #[arg(long, value_name = "TRAJECTORY", requires = "trajectory")]
    pub align: Option<PathBuf>,
    /// RUN folder in whose world the estimate is
    #[arg(long, value_name = "RUN", requires = "align")]
    pub trajectory: Option<PathBuf>,
    /// Largest time difference of frames matched for --align, in seconds
    #[arg(long, value_name = "S", default_value_t = DEFAULT_MAX_DT, value_parser = non_negative)]
    pub max_dt: f64,
    /// Trajectory from whose poses depth images of both meshes are compared, in the frame of the reference
    #[arg(long, value_name = "TRAJECTORY")]
    pub views: Option<PathBuf>,
    /// Move the estimate onto the reference by the surfaces too (points within 10 cm); hides errors of its pose
    #[arg(long)]
    pub icp: bool,
    /// Points on every mesh
    #[arg(long, value_name = "N", default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    pub samples: u32,
}
