//! Blur-aware bundle adjustment: a sharp map and the path of every exposure, from blurred frames.
//!
//! Every step renders the virtual views of one keyframe's exposure, averages them in linear light, takes the mean
//! through the camera's response and compares it with what was captured: colours, structural similarity (MBA-SLAM
//! eq. 62) and depth. The gradient moves the Gaussians and the keyframe's path together (MBA-SLAM section 3.3).

mod adam;
mod adjustment;
mod brightness;
mod bundle_state;
mod capacity;
mod density;
mod disc;
mod field_map;
mod frame_state;
mod gaussian_loss;
mod gaussian_map;
mod map_model;
mod mapped_frame;
mod moving;
mod optimiser_state;
mod path_metric;
mod path_step;
mod rectified;
mod scene_map;
mod schedule;
mod seed_view;
mod seeding;
mod smooth_depth;
mod world_moves;

pub use adjustment::{BundleAdjustment, BundleSettings, StepReport};
pub use brightness::{NOTICEABLE, Placed, log_brightness};
pub use bundle_state::{BorrowedBundleState, BundleProgress, BundleState};
pub use capacity::SeenSurface;
pub use field_map::FieldMap;
pub use frame_state::FrameState;
pub use gaussian_loss::GaussianLoss;
pub use gaussian_map::GaussianMap;
pub use map_model::{FitContext, MapModel};
pub use mapped_frame::{MapKeyframe, MappedFrame};
pub use path_metric::PathMetric;
pub use path_step::PathPrior;
pub use scene_map::SceneMap;
pub use schedule::{Schedule, Stage, StepPlan};
pub use seed_view::{DepthSource, SeedView};
pub use world_moves::{WorldMoves, moved_gaussian};
