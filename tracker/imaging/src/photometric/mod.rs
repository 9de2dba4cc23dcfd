//! From encoded bytes to the light that came in: the camera's response and the fall-off of its lens.

mod response;
mod vignetting;

pub use response::{InverseResponse, LuminanceTable};
pub use vignetting::{Vignetting, radius_squared};
