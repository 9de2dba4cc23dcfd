//! From a data set to a RUN folder: tracking, mapping, both at once, and what they need around them.

pub mod export;
pub mod mapping;
pub mod run;
pub mod self_calibration;
pub mod slam;
pub mod tracking;
mod uncertainty;
