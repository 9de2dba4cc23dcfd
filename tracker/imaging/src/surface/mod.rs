//! Depth maps at the resolution where their noise is spread over a few pixels: block means of inverse depth, and
//! the local planes of a keyframe's surface.
//!
//! Everything is in inverse depth because the noise of disparity-based sensors is uniform there, and because a
//! plane's inverse depth is linear in the image.

mod block_mean;
mod fusion;
mod planes;

pub use block_mean::{InverseDepthMap, spread_limit, spread_limits};
pub use fusion::{fuse_depth, fuse_lanes, lanes_of, store_lanes};
pub use planes::SurfacePlanes;
