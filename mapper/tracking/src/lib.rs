//! From a data set to the path of its camera: tracking forwards, the way back, and what the recording does not say of its camera.

pub mod hindsight;
pub mod self_calibration;
pub mod tracking;
mod uncertainty;

pub use mba_run::run;
