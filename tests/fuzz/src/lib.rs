//! What is fuzzed: one function per target, from any bytes to nothing. A target fails by a panic; what is refused with an
//! error is as it should be.
//!
//! `targets/` makes a program of each for libFuzzer; the test `fuzz_seeds` of the workspace replays what `seeds/` holds.

mod binaries;
mod c_interface;
mod checkpoints;
mod data_sets;
mod images;
mod numbers;
mod picture;
mod place;
mod recordings;
mod runs;
mod session;

pub use binaries::{field, gaussians, mesh};
pub use c_interface::c_interface;
pub use checkpoints::{checkpoint, resume_map, resume_slam, resume_track};
pub use data_sets::{calibration, exposure_times, ground_truth, inertial, lists, replica, response, scannet};
pub use images::{image, image_of_any_size};
pub use recordings::recording;
pub use runs::{run, trajectories};
pub use session::session;

/// A target: its name, which is that of its folder of seeds, and what it does.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 22] = [
    ("c_interface", c_interface),
    ("calibration", calibration),
    ("checkpoint", checkpoint),
    ("exposure_times", exposure_times),
    ("field", field),
    ("gaussians", gaussians),
    ("ground_truth", ground_truth),
    ("image", image),
    ("image_of_any_size", image_of_any_size),
    ("inertial", inertial),
    ("lists", lists),
    ("mesh", mesh),
    ("recording", recording),
    ("replica", replica),
    ("response", response),
    ("resume_map", resume_map),
    ("resume_slam", resume_slam),
    ("resume_track", resume_track),
    ("run", run),
    ("scannet", scannet),
    ("session", session),
    ("trajectories", trajectories),
];
