//! `mba ablate`.

mod slam;
mod tracker;

use mba_tracker::SimdLevel;

use super::repeats::Repeats;
use super::{calibrate, open};
use crate::args::Switch;
use crate::args::slam::{Ablate, Ablated};
use crate::console::Console;

/// Runs SLAM or the tracker with each part left out in turn and prints a table.
///
/// # Errors
/// As `mba slam` and `mba track`.
pub fn run(args: &Ablate, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let dataset = calibrate::completed(open::dataset(&args.dataset, simd)?, Switch::On, console)?;
    let maps = args.of == Ablated::Slam;
    let repeats = Repeats { dataset: dataset.folder(), maps, out: &args.out, count: args.repeats };
    match args.of {
        Ablated::Slam => slam::run(&dataset, repeats, console),
        Ablated::Track => tracker::run(&dataset, repeats, console),
    }
}
