//! Pixels: what the tracker does to an image before it looks at poses.

mod undistort;

pub use undistort::{
    BufferSizeError, NO_SOURCE, PixelRectangle, SourcePosition, fill_source_map, region_with_source,
    remap_bilinear, remap_nearest,
};
