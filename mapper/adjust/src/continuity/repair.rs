//! Repairing a sequence: cutting it where too much is missing, and replacing what is wrong on every piece.

use std::ops::Range;

use mba_io::statistics::quantile;
use mba_tracker::trajectory::ExposureTrajectory;
use rayon::prelude::*;

use super::fit::{FEWEST_FRAMES, Fit, fit};
use super::frame::validate;
use super::measured::{Held, Measured};
use super::{ContinuityError, ContinuityFrame, ContinuitySettings, Evidence, Suspicion};

/// Frames to either side that a suspected one is compared with.
const REFERENCES_PER_SIDE: usize = 2;

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameVerdict {
    /// Agrees with its neighbours, or there are too few of them to tell: the exposure is the measured one, bit for bit.
    Kept,
    /// Start and end were swapped; they are exchanged and otherwise as measured.
    Reversed,
    /// Measured in the wrong place: replaced by the path through the others.
    Replaced,
    /// Lost: taken from the path through the others.
    Bridged,
    /// Lost, and too far from other frames to tell where it was: the exposure is the given one.
    Unresolved,
}

/// How far from continuous a sequence is. Costs are half squared standard deviations, Huber beyond the settings' width,
/// so a sound sequence has some units per frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContinuityEnergy {
    /// Cost of the measured exposures against the path.
    pub measured: f64,
    /// The same without the outliers and in the right direction of time.
    pub repaired: f64,
    /// Cost of the jerk of the path.
    pub bending: f64,
}

impl ContinuityEnergy {
    fn add(&mut self, fit: &Fit) {
        self.measured += fit.mismatch;
        self.repaired += fit.mismatch_of_kept;
        self.bending += fit.bending;
    }
}

/// A repaired sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct Continuity {
    /// `world_from_camera` over every exposure.
    pub exposures: Vec<ExposureTrajectory>,
    /// What was done, one per frame.
    pub verdicts: Vec<FrameVerdict>,
    /// Cost before and after, over the whole sequence.
    pub energy: ContinuityEnergy,
}

impl Continuity {
    /// Indices of the frames with this verdict, ascending.
    #[must_use]
    pub fn frames_with(&self, verdict: FrameVerdict) -> Vec<usize> {
        (0..self.verdicts.len()).filter(|&k| self.verdicts[k] == verdict).collect()
    }
}

/// Finds swapped, misplaced and lost exposures of `frames` by the continuity of the camera's motion and repairs them;
/// all others stay as they are, bit for bit.
///
/// The sequence is cut where no frame was tracked for longer than the settings bridge. Pieces of fewer than five
/// tracked frames are left alone, and so are lost frames outside of all pieces. The result does not depend on the number
/// of threads.
///
/// # Errors
/// [`ContinuityError`] for invalid frames or settings, and if the conic solver gives up.
pub fn repair(
    frames: &[ContinuityFrame],
    settings: &ContinuitySettings,
) -> Result<Continuity, ContinuityError> {
    settings.validate()?;
    validate(frames)?;
    repair_others(frames, &vec![Held::default(); frames.len()], settings)
}

/// [`repair`] where what the frames show has the last word: a measured exposure that explains its frame as well as the
/// suggested one stays, and the others are judged again with it in its place. Where `evidence` says nothing, continuity
/// decides.
///
/// # Errors
/// As [`repair`].
pub fn repair_by_evidence(
    frames: &[ContinuityFrame],
    settings: &ContinuitySettings,
    evidence: &Evidence<'_>,
) -> Result<Continuity, ContinuityError> {
    settings.validate()?;
    validate(frames)?;
    let mut held = vec![Held::default(); frames.len()];
    loop {
        // 1. What continuity says, with those in their place that evidence has put there.
        let result = repair_others(frames, &held, settings)?;
        let suspects: Vec<usize> = (0..frames.len()).filter(|&k| result.contradicts_measurement(k)).collect();
        // 2. Frames that it contradicts are asked for their pictures. No answer depends on another.
        let found = suspects.par_iter().map(|&k| (k, result.held_by(frames, k, evidence)));
        let found: Vec<(usize, Held)> = found.filter(|(_, held)| *held != Held::default()).collect();
        if found.is_empty() {
            return Ok(result);
        }
        // 3. Who is held is never let go, so that this ends.
        for (k, more) in found {
            held[k].place |= more.place;
            held[k].direction |= more.direction;
        }
    }
}

/// Repairs all frames but those that are held.
fn repair_others(
    frames: &[ContinuityFrame],
    held: &[Held],
    settings: &ContinuitySettings,
) -> Result<Continuity, ContinuityError> {
    let unjudged = |frame: &ContinuityFrame| match frame.noise {
        Some(_) => FrameVerdict::Kept,
        None => FrameVerdict::Unresolved,
    };
    let mut result = Continuity {
        exposures: frames.iter().map(|frame| frame.world_from_camera).collect(),
        verdicts: frames.iter().map(unjudged).collect(),
        energy: ContinuityEnergy::default(),
    };
    let Some(interval) = usual_interval(frames) else { return Ok(result) };
    for piece in pieces(frames, settings.longest_gap * interval) {
        // Lost frames have measured nothing; they are bridged by the path of the others.
        let pairs = frames[piece.clone()].iter().zip(&held[piece.clone()]);
        let measured: Vec<Measured> = pairs.filter_map(|(frame, held)| measured(frame, *held)).collect();
        if measured.len() < FEWEST_FRAMES {
            continue;
        }
        let fit = fit(&measured, interval, settings).map_err(|status| ContinuityError::Unsolved {
            first: piece.start,
            last: piece.end - 1,
            status,
        })?;
        result.apply(frames, piece, &fit);
    }
    Ok(result)
}

impl Continuity {
    fn contradicts_measurement(&self, k: usize) -> bool {
        matches!(self.verdicts[k], FrameVerdict::Replaced | FrameVerdict::Reversed)
    }

    /// What the evidence holds of frame `k` against its verdict.
    fn held_by(&self, frames: &[ContinuityFrame], k: usize, evidence: &Evidence<'_>) -> Held {
        let references = self.references(frames, k);
        let suspicion = Suspicion {
            frame: k,
            measured: &frames[k].world_from_camera,
            suggested: &self.exposures[k],
            references: &references,
        };
        let Some(mismatch) = evidence(&suspicion) else { return Held::default() };
        match self.verdicts[k] {
            FrameVerdict::Replaced => {
                Held { place: mismatch.holds_place(frames[k].trusted), direction: false }
            }
            _ => Held { place: false, direction: mismatch.holds_direction() },
        }
    }

    /// The nearest frames to either side of `k` that stay in their place, nearest first.
    fn references(&self, frames: &[ContinuityFrame], k: usize) -> Vec<(usize, ExposureTrajectory)> {
        let in_place = |l: &usize| matches!(self.verdicts[*l], FrameVerdict::Kept | FrameVerdict::Reversed);
        // A replaced or bridged frame shows nothing that another could be compared with.
        let before = (0..k).rev().filter(in_place).take(REFERENCES_PER_SIDE);
        let after = (k + 1..frames.len()).filter(in_place).take(REFERENCES_PER_SIDE);
        let mut references: Vec<usize> = before.chain(after).collect();
        references.sort_by_key(|l| (l.abs_diff(k), *l));
        references.into_iter().map(|l| (l, frames[l].world_from_camera)).collect()
    }

    fn apply(&mut self, frames: &[ContinuityFrame], piece: Range<usize>, fit: &Fit) {
        self.energy.add(fit);
        let mut judgements = fit.judgements.iter();
        for k in piece {
            // Only tracked frames have a judgement, in their order.
            let judgement = frames[k].noise.and_then(|_| judgements.next());
            self.verdicts[k] = match judgement {
                None => FrameVerdict::Bridged,
                Some(judgement) if judgement.outlier => FrameVerdict::Replaced,
                Some(judgement) if judgement.reversed => FrameVerdict::Reversed,
                Some(_) => FrameVerdict::Kept,
            };
            self.exposures[k] = match self.verdicts[k] {
                FrameVerdict::Bridged | FrameVerdict::Replaced => fit.path.exposure(frames[k].shutter()),
                FrameVerdict::Reversed => frames[k].world_from_camera.reversed(),
                FrameVerdict::Kept | FrameVerdict::Unresolved => frames[k].world_from_camera,
            };
        }
    }
}

fn measured(frame: &ContinuityFrame, held: Held) -> Option<Measured> {
    frame.noise.map(|noise| Measured {
        held,
        timestamp: frame.timestamp,
        shutter: frame.shutter(),
        exposure: frame.world_from_camera,
        noise,
    })
}

/// Median time between frames; `None` for fewer than two.
pub(super) fn usual_interval(frames: &[ContinuityFrame]) -> Option<f64> {
    let intervals: Vec<f64> = frames.windows(2).map(|w| w[1].timestamp - w[0].timestamp).collect();
    quantile(&intervals, 0.5)
}

/// Runs of frames that start and end with a tracked one, without tracked neighbours more than `longest_gap` apart.
fn pieces(frames: &[ContinuityFrame], longest_gap: f64) -> Vec<Range<usize>> {
    let mut pieces: Vec<Range<usize>> = Vec::new();
    for (k, frame) in frames.iter().enumerate().filter(|(_, frame)| frame.noise.is_some()) {
        match pieces.last_mut() {
            Some(piece) if frame.timestamp - frames[piece.end - 1].timestamp <= longest_gap => {
                piece.end = k + 1;
            }
            _ => pieces.push(k..k + 1),
        }
    }
    pieces
}
