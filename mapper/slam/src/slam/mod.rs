//! Tracking and mapping at the same time.
//!
//! Two threads and two bounded queues. The *front end* tracks one frame after the other; the *back end* takes them in,
//! makes keyframes of those that show something new, adjusts map and exposures with a fixed effort per frame, and
//! renders sharp views of the map near the camera, which the next frames are aligned with (MBA-SLAM section 3). In lock
//! step the tracker follows the instructions of the frame before last, so that both threads are busy and the result is
//! still the same on every machine.
//!
//! A run in lock step that is stopped leaves a checkpoint; started again with `resume` it ends with the same
//! files, bit for bit, as one that was never stopped.
//!
//! After the last frame all of the map is refined together with all paths, as [`crate::mapping`] does.

mod arrival_clock;
mod back_end;
mod driver;
mod error;
mod front_end;
mod growing_map;
mod keyframe_choice;
mod loops;
mod messages;
mod progress;
mod relocaliser;
mod saved;
mod settings;
mod sharp_view;
mod tracker_state;

pub use driver::run_slam;
pub use error::SlamError;
pub(crate) use keyframe_choice::view_change;
pub(crate) use messages::SharpView;
pub use progress::SlamProgress;
pub(crate) use relocaliser::Relocaliser;
pub use settings::{Arrival, SlamReference, SlamSettings};
