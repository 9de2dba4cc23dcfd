//! The keyframes of a run, all at once.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use mba_adjust::deblurring::{DeblurError, DeblurMemory, KeyframeDeblurrer};
use mba_io::dataset::Dataset;
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::TrackerConfig;
use rayon::prelude::*;

use super::{RunError, RunWriter, deblurred_path};

/// Why a keyframe has no image.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error(transparent)]
    Image(#[from] DeblurError),
    #[error(transparent)]
    Output(#[from] RunError),
}

/// Deblurs every keyframe that `run` has by now with the exposure that `run` has for it, and writes the images into
/// the run's folder. Call it after the last frame: by then all exposures are final. `observe` is called after each
/// keyframe, from any thread, and says whether to go on; the result says whether all were written. Images that lie in the
/// folder are not made again: those of another run are removed before a run begins.
///
/// A keyframe that cannot be read is left out, and `run` gets a warning that says why. The images do not depend on the
/// number of threads.
///
/// # Errors
/// [`RunError`] when an image cannot be written.
pub fn write_deblurred_keyframes(
    dataset: &Dataset,
    config: &TrackerConfig,
    run: &mut RunWriter,
    observe: impl Fn() -> ControlFlow<()> + Sync,
) -> Result<ControlFlow<()>, RunError> {
    let keyframes = run.record().keyframes();
    // Threads would make their memory all the same.
    if keyframes.is_empty() {
        return Ok(ControlFlow::Continue(()));
    }
    let is_stopped = AtomicBool::new(false);
    let deblurrer = KeyframeDeblurrer::new(config, dataset.simd());
    let write = |memory: &mut DeblurMemory, (index, exposure): (usize, TimedExposure)| {
        let is_there = deblurred_path(run.folder(), index).is_file();
        let written = if is_there || is_stopped.load(Ordering::Relaxed) {
            Ok(())
        } else {
            write_keyframe(dataset, &deblurrer, run, index, &exposure, memory)
        };
        if observe().is_break() {
            is_stopped.store(true, Ordering::Relaxed);
        }
        (index, written)
    };
    let outcomes: Vec<_> = keyframes.into_par_iter().map_init(|| deblurrer.memory(), write).collect();
    for (index, outcome) in outcomes {
        match outcome {
            Ok(()) => run.count_deblurred(),
            Err(Failure::Output(error)) => return Err(error),
            Err(Failure::Image(reason)) => {
                run.record_mut().warn(format!("keyframe {index} not deblurred: {reason}"))
            }
        }
    }
    Ok(if is_stopped.into_inner() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
}

fn write_keyframe(
    dataset: &Dataset,
    deblurrer: &KeyframeDeblurrer,
    run: &RunWriter,
    index: usize,
    exposure: &TimedExposure,
    memory: &mut DeblurMemory,
) -> Result<(), Failure> {
    let frame = dataset.frame(index).map_err(DeblurError::from)?;
    let deblurred = deblurrer.deblur(&frame, exposure, memory)?;
    run.write_deblurred(index, [frame.width, frame.height], deblurred.rgb)?;
    Ok(())
}
