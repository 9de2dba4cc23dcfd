//! Images in the caller's memory: views of input frames and linear-light pyramids.

mod pyramid;
mod view;

pub use pyramid::{GreyLevel, GreyPyramid, MAX_LEVELS};
pub use view::{ColourView, DepthView, PixelFormat};
