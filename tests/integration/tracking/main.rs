//! The tracker as a whole, on short rendered sequences.

mod bad_input;
mod effort;
mod faults;
mod hindsight;
mod memory;
mod noise;
mod outside;
mod recovery;
mod reference_view;
mod rolling;
mod scenes;
mod self_calibration;
mod sequences;
mod session;
mod work;
