//! The true surface, as far as the frames of a sequence see it.

use std::collections::HashSet;

use super::SynthSequence;

/// One point per cell of a grid of this edge, metres.
const CELL: f32 = 0.01;

/// Most frames whose view is looked at, evenly chosen.
const MAX_VIEWS: usize = 100;

impl SynthSequence {
    /// Points of the true surface that frames see at mid exposure: world, metres, about a centimetre apart where pixels
    /// are that dense; meshes can be judged by them.
    #[must_use]
    pub fn surface_points(&self) -> Vec<[f32; 3]> {
        points(self)
    }
}

/// Points of the world (metres) that frames see at mid exposure, about a centimetre apart where pixels are that dense;
/// in order of the frames.
fn points(sequence: &SynthSequence) -> Vec<[f32; 3]> {
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
