//! From a tracked run to a map: keyframes are chosen, their exposures repaired, the bundle adjusted, the frames between
//! keyframes fitted to the map, and everything written into a RUN folder.
//!
//! A run that is stopped at any moment leaves a RUN folder with the tracked poses and a checkpoint; started again with
//! `resume` it ends with the same files, bit for bit, as one that was never stopped. Only a time budget makes results
//! depend on how fast the machine is.

mod choice;
mod driver;
mod error;
mod evidence;
mod finish;
mod observations;
mod other_frames;
mod output;
mod part;
mod picture_figures;
mod prepare;
mod run_continuity;
mod settings;

pub(crate) use driver::{Checkpoint, Running, dataset_fingerprint};
pub use driver::{MapProgress, map_dataset, map_part};
pub use error::MapError;
pub(crate) use finish::Finish;
pub use observations::sensor;
pub use output::peak_memory_bytes;
pub use part::{MapPart, MappedKeyframe, MappedPart};
pub use picture_figures::picture_figures;
pub use run_continuity::{RepairedRun, repair_run, run_frames};
pub use settings::MapSettings;
