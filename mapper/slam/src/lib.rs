//! From a data set to a RUN folder: tracking, mapping, both at once, and what they need around them.

pub mod hindsight;
pub mod mapping;
pub mod self_calibration;
pub mod slam;
pub mod tracking;
mod uncertainty;

pub use mba_run::{export, run};
