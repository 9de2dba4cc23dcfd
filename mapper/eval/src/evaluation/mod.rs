//! How good an estimate is: pure functions on slices, no files.
//!
//! Trajectory figures follow the definitions of the `evo` package (`evo_ape`, `evo_rpe`), so that numbers can be
//! compared with published ones.

mod alignment;
mod association;
mod exposure;
mod figures;
mod icp;
mod image;
mod kd_tree;
mod mesh_depth;
mod plausibility;
mod pose_alignment;
mod surface;
mod trajectory;

pub use alignment::{AlignmentError, Similarity, TrajectoryAlignment, align};
pub use association::{DEFAULT_MAX_DT, Match, associate};
pub use exposure::{BlurEvaluation, BlurFrame, MIN_TRUE_BLUR_PX, evaluate_blur};
pub use figures::{BlurFigures, TrajectoryFigures};
pub use icp::refine_by_icp;
pub use image::{DepthDifference, ImageError, depth_difference, psnr, ssim};
pub use kd_tree::KdTree;
pub use mesh_depth::{MeshDepthError, MeshDepthFigures, evaluate_mesh_depth};
pub use plausibility::{MotionPlausibility, motion_plausibility};
pub use pose_alignment::{PoseAlignment, PoseAlignmentError, align_poses};
pub use surface::{MeanMedian, SurfaceComparisonError, SurfaceFigures, ThresholdFigures, evaluate_surface};
pub use trajectory::{
    GOOD_FRAME_METRES, TrajectoryError, TrajectoryEvaluation, TrajectoryOptions, evaluate_trajectory,
};
