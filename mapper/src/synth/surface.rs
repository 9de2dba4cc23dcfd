//! The true surface, as far as the frames of a sequence see it.

use std::collections::HashSet;

use super::SynthSequence;

/// One point per cell of a grid of this edge, metres.
const CELL: f32 = 0.01;

/// Most frames whose view is looked at, evenly chosen.
const MAX_VIEWS: usize = 100;

/// Points of the world (metres) that frames see at mid exposure, about a centimetre apart where pixels are that dense;
/// in order of the frames.
pub(super) fn points(sequence: &SynthSequence) -> Vec<[f32; 3]> {
    let views = sequence.len().min(MAX_VIEWS);
    let mut taken = HashSet::new();
    let mut points = Vec::new();
    for view in 0..views {
        let frame = view * sequence.len() / views;
        let seen = sequence.seen_points(frame).into_iter();
        points.extend(seen.filter(|point| taken.insert(point.map(|x| (x / CELL).floor() as i32))));
    }
    points
}
