//! Arguments of `mba localise`.

use std::path::PathBuf;

use clap::Args;

use super::Switch;

/// Arguments of `mba localise`.
#[derive(Debug, Args)]
#[command(after_help = "\
The recording must show the place that the map of RUN shows; its camera may be another one. Where a frame looks like a view \
of the map from where RUN's camera was, or from aside, it is aligned with what the map shows, and the frames after it are \
tracked against the map from there. OUT gets trajectory.txt, exposures.txt, frames.csv and summary.json as `mba track` \
writes them, with poses in the world of RUN's map. Frames that are not found are lost; without any the exit code is 1.

Examples:
  mba localise run data/second --out second
  mba localise whole today --out today-in-whole --self-calibrate off")]
pub struct Localise {
    /// RUN folder with a map
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Folder of the data set to find in it
    #[arg(value_name = "RECORDING")]
    pub recording: PathBuf,
    /// RUN folder to write; an earlier run in it is replaced
    #[arg(long, value_name = "OUT")]
    pub out: PathBuf,
    /// Write also over what this program did not write; never over a data set
    #[arg(long)]
    pub force: bool,
    /// Find exposure and readout times that are not on record from the recording first, or assume the usual
    #[arg(long, value_enum, default_value_t)]
    pub self_calibrate: Switch,
}
