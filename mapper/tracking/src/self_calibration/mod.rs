//! What is not on record about a camera, found from the recording itself.
//!
//! Exposure times follow from motion: what moves within an exposure, over the velocity between the poses at mid exposure.
//! They are tied to each other by the brightness of the frames. The readout time of a camera whose rows are exposed one
//! after the other is the one with which the edges of colour lie on the jumps of depth; they also tell by how much depth
//! is late. Where both roll, the readout follows from motion like the exposures. A stretch of the recording is tracked again and again with what is supposed, until the motion agrees with it. How light falls off towards the corners
//! shows on surfaces that are seen in several places of the image. What
//! a recording cannot tell is said to be unknown; the metre of depth is told by an accelerometer only.
//!
//! Sources: exposure from blur, e.g. Gong et al. (CasualHDRSplat), 2025; readout as an unknown of the camera, e.g. Kerl,
//! Stueckler and Cremers, ICCV 2015.

mod brightness;
mod complete;
mod contradiction;
mod depth_edges;
mod depth_lag;
mod depth_time;
mod exposure;
mod exposure_times;
mod finding;
mod focal;
mod metre;
mod motion;
mod patches_of_light;
mod readout;
mod reduced;
mod robust;
mod score;
mod stored;
mod vignetting;
mod window;

pub use complete::{complete, is_complete};
pub use contradiction::{
    Contradiction, GyroscopeFault, contradictions, gyroscope_fault, quick_contradictions,
};
pub use depth_lag::{DepthLag, depth_lag, depth_lag_of_tracked};
pub use finding::{Finding, Value};
pub use focal::focal_length;
pub use metre::{DistanceError, depth_scale, depth_scale_by_distance};
pub use stored::{
    ESTIMATED_EXPOSURES_FILE, ESTIMATED_FILE, StoredError, has_estimates, read_back, remove, write,
};
pub use vignetting::vignetting;
