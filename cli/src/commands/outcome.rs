//! Whether a run achieved anything, and why not.

use mba_mapper::dataset::{Dataset, Survey, survey};
use mba_mapper::run::{FrameRecord, FrameStatus, Summary};

use crate::console::Console;
use crate::failure::failed;

/// Frames that are looked at for the reason of a failure.
const SAMPLED_FRAMES: usize = 16;

/// A share of frames that are lost above which a finished run is worth a warning.
const WORRYING_SHARE: f64 = 0.1;

/// Advice for a recording that cannot be tracked.
const HINT: &str = "`mba info DATASET` shows what the images hold";

/// Whether no frame was found by aligning it: the first one of any input is where the world begins.
#[must_use]
pub fn nothing_tracked(frames: &[FrameRecord]) -> bool {
    let tracked = frames.iter().filter(|frame| frame.status != FrameStatus::Lost).count();
    tracked < frames.len().min(2)
}

/// Fails for a run without any tracked frame, and warns of one with many lost.
///
/// # Errors
/// The failure, with the reason.
pub fn check(summary: &Summary, dataset: &Dataset, console: &Console) -> anyhow::Result<()> {
    let counts = summary.frames;
    if counts.ok + counts.weak < counts.total.min(2) {
        return Err(failure(dataset, ""));
    }
    let not_tried = counts.skipped;
    let lost = counts.lost - not_tried.min(counts.lost);
    if lost as f64 > WORRYING_SHARE * counts.total as f64 {
        console.warning(format!("{lost} of {} frames could not be aligned and are lost", counts.total));
    }
    Ok(())
}

/// The failure of tracking `dataset`, with the reason that a look at its images gives and a remark.
#[must_use]
pub fn failure(dataset: &Dataset, remark: &str) -> anyhow::Error {
    failed(format!("nothing could be tracked: {}{remark}", reason(dataset)), HINT)
}

/// Why nothing can be tracked, in a sentence.
fn reason(dataset: &Dataset) -> String {
    what_is_missing(&survey(dataset, SAMPLED_FRAMES)).unwrap_or_else(|| {
        format!("no frame of {} could be aligned with another", dataset.folder().display())
    })
}

/// What a look at the images says against tracking any of them, in a sentence; `None` where nothing does.
#[must_use]
pub fn what_is_missing(survey: &Survey) -> Option<String> {
    let Survey { sampled, unreadable, black, plain, without_depth, swapped_depth, .. } = survey;
    let readable = sampled - unreadable.len();
    // A single frame that is good can be the first: nothing follows it that could be aligned.
    let is_all_but_one = |count: usize| count > 0 && count + 1 >= readable;
    match unreadable.first() {
        Some(error) if readable < 2 => {
            let unreadable = unreadable.len();
            Some(format!(
                "{unreadable} of {sampled} sampled frames cannot be read, the first because {error}"
            ))
        }
        _ if is_all_but_one(*black) => Some(format!("{black} of {readable} sampled colour images are black")),
        _ if is_all_but_one(*plain) => {
            Some(format!("{plain} of {readable} sampled colour images show nothing, all of one colour"))
        }
        _ if is_all_but_one(*without_depth) => {
            Some(format!("{without_depth} of {readable} sampled depth images hold no depth at all"))
        }
        _ if is_all_but_one(*swapped_depth) => Some(swapped(*swapped_depth, readable)),
        _ => None,
    }
}

/// That `count` of `sampled` depth images have the bytes of their values exchanged.
#[must_use]
pub fn swapped(count: usize, sampled: usize) -> String {
    format!(
        "{count} of {sampled} sampled depth images look byte-swapped, neighbouring pixels lie closer with the two bytes of \
         each value exchanged (a 16-bit PNG has the high byte first)"
    )
}
