//! What a sensor makes of light, and what it captured: response, curve of display values, and frames at their resolutions.

mod display_curve;
mod forward_response;
mod observation;

pub use display_curve::DisplayCurve;
pub use forward_response::ForwardResponse;
pub use observation::{Observation, ObservationPyramid, Sensor};
