//! Images in the caller's memory: undistortion, views of input frames and linear-light pyramids.

mod bilinear;
mod pyramid;
mod remap;
mod undistort;
mod view;

pub use bilinear::{BilinearSampler, Cell, Sampled};
pub use pyramid::{GreyLevel, GreyPyramid, LevelImage, MAX_LEVELS};
pub use remap::{remap_bilinear, remap_nearest};
pub use undistort::{
    BufferSizeError, NO_SOURCE, PixelRectangle, SourcePosition, fill_source_map, region_with_source,
};
pub use view::{ColourView, DepthView, ExtentError, PixelFormat};
