//! Where the camera of one recording was in the map of another run.
//!
//! A first frame is recognised among views of the map from where the run's camera was, from aside, nearer and further away, and
//! found by aligning it with what the map shows. From there on every frame is tracked against a view of the map from the pose
//! before: errors do not add up, since the map stays as it is. A camera that looks past the map goes on with keyframes of its
//! own until it sees the map again. Frames that were lost on the way are looked for from their neighbours afterwards.

mod driver;
mod known_map;
mod places;

pub use driver::{LocaliseError, localise};
pub use known_map::KnownMap;
