//! From a tracked run or a data set to a RUN folder with a map: mapping, tracking and mapping at once, and finding a recording in
//! the map of another run.

pub mod localisation;
pub mod mapping;
pub mod slam;

pub use mba_run::{export, run};
pub use mba_tracking::{hindsight, self_calibration, tracking};
