//! From a tracked run or a data set to a RUN folder with a map: mapping, and tracking and mapping at once.

pub mod mapping;
pub mod slam;

pub use mba_run::{export, run};
pub use mba_tracking::{hindsight, self_calibration, tracking, uncertainty};
