//! Swapped, misplaced and lost exposures among those of a shaking camera.

mod bad_input;
mod evidence;
mod faults;
mod prediction;
mod run_data;
mod shaken;
