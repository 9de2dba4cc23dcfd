//! Depth that is listed with the picture of the frame before or after its own.
//!
//! No pose is needed: the jumps of a depth image lie on the edges of the picture of its own time, more than on those of the
//! neighbours while the camera moves.

use std::fmt;

use rayon::prelude::*;

use super::depth_edges::{gradient, jumps};
use mba_io::dataset::{Dataset, Knowledge, RgbdFrame};

/// Frames that are looked at.
const SAMPLES: usize = 16;

/// Fewest frames in which the camera has to have moved.
const FEWEST_FRAMES: usize = 6;

/// Fewest jumps of a depth image that say anything.
const FEWEST_JUMPS: usize = 200;

/// By how much the edges have to be stronger under the jumps of a neighbour's depth in one frame, and in the mean of all.
/// Right depth is a third to two fifths weaker there, depth that is half a frame late as strong.
const STRONGER: f64 = 1.02;
const STRONGER_IN_MEAN: f64 = 1.1;

/// Contradiction between picture and depth in the median frame of a tracked recording above which depth may be that of
/// another frame. Noise alone gives less than 1, depth that is one frame off 7.
const CONTRADICTION: f64 = 3.0;

/// Share of the frames that have to agree.
const AGREEING_SHARE: f64 = 0.8;

/// Depth images that belong to the picture of the frame before or after the one that they are listed with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthLag {
    /// Whether each depth image shows what the frame before showed; else it shows what the next one will.
    pub is_late: bool,
    /// When depth was measured, seconds after the picture that it is listed with; negative where it is late.
    pub delay_seconds: f64,
    /// Sampled frames that say so.
    pub agreeing: usize,
    /// Sampled frames that can tell.
    pub sampled: usize,
}

impl fmt::Display for DepthLag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (late, other) = if self.is_late { ("late", "next") } else { ("early", "previous") };
        write!(
            f,
            "depth comes one frame {late}: in {} of {} sampled frames the {other} depth image lies better on the picture; \
             list it with that picture, or put depth_delay_seconds = {:.4} into the calibration",
            self.agreeing, self.sampled, self.delay_seconds
        )
    }
}

/// Looks for depth that is one frame late or early; none where the recording does not say so, or when depth was
/// measured is on record.
#[must_use]
pub fn depth_lag(dataset: &Dataset) -> Option<DepthLag> {
    let is_known = dataset.calibration().sources.depth_delay != Knowledge::Assumed;
    if is_known || dataset.len() < FEWEST_FRAMES + 2 {
        return None;
    }
    // The first and the last frame have no neighbour on one side.
    let inner = dataset.len() - 2;
    let count = inner.min(SAMPLES);
    let indices: Vec<usize> = (0..count).map(|k| 1 + k * inner / count).collect();
    let ratios: Vec<[f64; 2]> =
        indices.par_iter().filter_map(|index| neighbours_over_own(dataset, *index)).collect();
    let sampled = ratios.len();
    if sampled < FEWEST_FRAMES {
        return None;
    }
    let verdict = |side: usize| {
        let agreeing = ratios.iter().filter(|ratio| ratio[side] > STRONGER).count();
        let mean = ratios.iter().map(|ratio| ratio[side]).sum::<f64>() / sampled as f64;
        let is_told = agreeing as f64 >= AGREEING_SHARE * sampled as f64 && mean > STRONGER_IN_MEAN;
        is_told.then_some(agreeing)
    };
    let found = |is_late: bool, agreeing: usize| {
        let interval = 1.0 / dataset.calibration().frame_rate;
        let delay_seconds = if is_late { -interval } else { interval };
        DepthLag { is_late, delay_seconds, agreeing, sampled }
    };
    // The next depth image fits better: depth is late. If both fit better, the edges say nothing.
    match [verdict(0), verdict(1)] {
        [None, Some(agreeing)] => Some(found(true, agreeing)),
        [Some(agreeing), None] => Some(found(false, agreeing)),
        _ => None,
    }
}

/// As [`depth_lag`], once a recording has been tracked: nothing is read where picture and depth agree. `disagreement` is that
/// of the median frame, as [`track_and_keep`](crate::tracking::track_and_keep) returns it.
#[must_use]
pub fn depth_lag_of_tracked(dataset: &Dataset, disagreement: f64) -> Option<DepthLag> {
    if disagreement > CONTRADICTION { depth_lag(dataset) } else { None }
}

/// How strong the edges of frame `index` are under the jumps of the depth before and after its own, over those under its
/// own; none where that says nothing.
fn neighbours_over_own(dataset: &Dataset, index: usize) -> Option<[f64; 2]> {
    let own = dataset.frame(index).ok()?;
    let gradient = gradient(&own);
    let strength = |frame: &RgbdFrame| {
        let places = jumps(frame);
        let at = |[u, v]: [f64; 2]| u64::from(gradient[v as usize * frame.width + u as usize]);
        let sum: u64 = places.iter().map(|(place, _)| at(*place)).sum();
        (places.len() >= FEWEST_JUMPS && sum > 0).then(|| sum as f64 / places.len() as f64)
    };
    let of_own = strength(&own)?;
    let before = strength(&dataset.frame(index - 1).ok()?)?;
    let after = strength(&dataset.frame(index + 1).ok()?)?;
    Some([before / of_own, after / of_own])
}
