//! Rendering of what a moving camera sees while its shutter is open.
//!
//! A blurred image is the mean, in linear light, of virtual views along the exposure (MBA-SLAM eq. 2 and 3). Depth
//! and alpha are not blurred: they are those at mid exposure. Where rows are exposed one after the other, each has an
//! exposure of its own, and depth may be that of another time. The gradient of a loss goes back through every view to
//! the Gaussians and to the poses at shutter opening and closing.

mod blur;
mod path;
mod renderer;
mod rows;
mod scratch;
mod tape;
mod timing;

pub use blur::{blur_length, motion_of};
pub use path::{ExposurePath, PATH_PARAMETERS};
pub use renderer::ExposureRenderer;
pub use scratch::ExposureScratch;
pub use tape::ExposureTape;
pub use timing::{RowTimes, RowTiming};
