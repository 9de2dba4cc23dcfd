//! Normalised correlation of two thumbnails under shifts.

use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::Vector3;

use super::PlaceDescriptor;

/// Furthest shift along each axis, thumbnail pixels: a seventh of the width.
const REACH: isize = 3;

/// Shifts along one axis.
const SHIFTS: usize = (2 * REACH + 1) as usize;

impl PlaceDescriptor {
    /// How much a stored view looks like this one, -1 to 1, and the rotation `stored_from_query` that fits best. Views of
    /// cameras with another aspect ratio have nothing in common: 0.
    #[must_use]
    pub fn compare(&self, stored: &Self) -> (f32, RigidTransform) {
        if self.height != stored.height {
            return (0.0, RigidTransform::identity());
        }
        let (similarity, [right, down]) = best_shift(self, stored);
        // A turn to the right moves the image to the left: about y by the shift, about x against it.
        let turn = Vector3::new(-(down / self.focal[1]).atan(), (right / self.focal[0]).atan(), 0.0);
        let stored_from_query = RigidTransform::new(so3::exp(&turn), Vector3::zeros());
        (similarity, stored_from_query)
    }
}

/// Largest correlation over all shifts, and the shift in thumbnail pixels (right, down) that takes `query` to it in
/// `stored`, refined between pixels.
fn best_shift(query: &PlaceDescriptor, stored: &PlaceDescriptor) -> (f32, [f64; 2]) {
    let mut correlations = [[0.0; SHIFTS]; SHIFTS];
    let (mut best, mut place) = (f32::NEG_INFINITY, [0; 2]);
    for (row, line) in correlations.iter_mut().enumerate() {
        for (column, value) in line.iter_mut().enumerate() {
            *value = correlation(query, stored, [column as isize - REACH, row as isize - REACH]);
            if *value > best {
                (best, place) = (*value, [column, row]);
            }
        }
    }
    let [column, row] = place;
    let along_row = |k: usize| correlations[row][k];
    let along_column = |k: usize| correlations[k][column];
    (best, [refined(column, &along_row), refined(row, &along_column)])
}

/// Shift of the peak of a parabola through the largest value and its neighbours.
fn refined(index: usize, value: &dyn Fn(usize) -> f32) -> f64 {
    let whole = (index as isize - REACH) as f64;
    if index == 0 || index + 1 == SHIFTS {
        return whole;
    }
    let [before, here, after] = [index - 1, index, index + 1].map(|k| f64::from(value(k)));
    let bend = 2.0 * here - before - after;
    if bend > 1e-9 { whole + (0.5 * (after - before) / bend).clamp(-0.5, 0.5) } else { whole }
}

/// Correlation coefficient of `query(p)` and `stored(p + shift)` over the pixels that both have.
fn correlation(query: &PlaceDescriptor, stored: &PlaceDescriptor, [right, down]: [isize; 2]) -> f32 {
    let overlap = |size: usize, shift: isize| {
        let size = size as isize;
        (-shift).max(0) as usize..(size - shift).min(size).max(0) as usize
    };
    let (columns, rows) = (overlap(query.width, right), overlap(query.height, down));
    let count = (columns.len() * rows.len()) as f32;
    let moved = |k: usize, shift: isize| (k as isize + shift) as usize;
    let (mut a, mut b, mut aa, mut bb, mut ab) = (0.0_f32, 0.0, 0.0, 0.0, 0.0);
    for row in rows {
        let from = &query.values[row * query.width..][columns.clone()];
        let start = moved(row, down) * stored.width + moved(columns.start, right);
        for (x, y) in from.iter().zip(&stored.values[start..]) {
            a += x;
            b += y;
            aa += x * x;
            bb += y * y;
            ab += x * y;
        }
    }
    let spread = ((aa - a * a / count) * (bb - b * b / count)).max(0.0).sqrt();
    if spread > 1e-6 { (ab - a * b / count) / spread } else { 0.0 }
}
