//! The box of space that a field covers.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::settings::COARSE_CELL;

/// Most coarse cells along one side of a box: 123 m.
pub(super) const MOST_CELLS: u32 = 512;

/// A box of whole coarse cells, in the world.
///
/// Cells lie on a grid through the origin of the world, so that a larger box has all cells of a smaller one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Region {
    /// First cell along x, y and z.
    pub(super) first: [i32; 3],
    /// Number of cells along x, y and z, 1 to [`MOST_CELLS`].
    pub(super) cells: [u32; 3],
}

impl Region {
    /// The smallest box that has both corners (world, metres) in it. Corners are bounded to ±256 cells from
    /// the origin; what is no number counts as 0.
    #[must_use]
    pub fn around(least: [f64; 3], most: [f64; 3]) -> Self {
        let bound = f64::from(MOST_CELLS / 2);
        let index = |x: f64| if x.is_finite() { (x / COARSE_CELL).clamp(-bound, bound) } else { 0.0 };
        let first = least.map(|x| index(x).floor() as i32);
        let end = most.map(|x| index(x).ceil() as i32);
        let cells = core::array::from_fn(|axis| {
            u32::try_from(end[axis] - first[axis]).unwrap_or(0).clamp(1, MOST_CELLS)
        });
        Self { first, cells }
    }

    /// The smallest box that has all of both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let first: [i32; 3] = core::array::from_fn(|axis| self.first[axis].min(other.first[axis]));
        let cells = core::array::from_fn(|axis| {
            let end = |region: &Self| region.first[axis] + region.cells[axis] as i32;
            (end(self).max(end(other)) - first[axis]) as u32
        });
        Self { first, cells }
    }

    /// The corner with the least coordinates, metres.
    #[must_use]
    pub fn origin(&self) -> Vector3<f64> {
        Vector3::from(self.first.map(|cell| f64::from(cell) * COARSE_CELL))
    }

    /// The corner opposite of [`Self::origin`], metres.
    #[must_use]
    pub fn end(&self) -> Vector3<f64> {
        self.origin() + Vector3::from(self.cells.map(|cells| f64::from(cells) * COARSE_CELL))
    }

    /// Volume, cubic metres.
    #[must_use]
    pub fn volume(&self) -> f64 {
        (self.end() - self.origin()).product()
    }

    /// Where a ray, from `origin` on along `direction`, leaves the box, in lengths of `direction`; 0 if it never was in.
    #[must_use]
    pub fn exit(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
        let (least, most) = (self.origin(), self.end());
        let (mut enter, mut exit) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let to = [least, most].map(|corner| (corner[axis] - origin[axis]) / direction[axis]);
            if to.iter().all(|to| to.is_finite()) {
                enter = enter.max(to[0].min(to[1]));
                exit = exit.min(to[0].max(to[1]));
            }
        }
        if exit.is_finite() && exit > enter { exit } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_snapped_and_grow() {
        let small = Region::around([-0.1, 0.0, 1.0], [0.3, 0.24, 1.1]);
        assert_eq!((small.first, small.cells), ([-1, 0, 4], [3, 1, 1]));
        let large = small.union(&Region::around([0.0, -0.5, 0.0], [1.0, 0.1, 1.0]));
        assert_eq!((large.first, large.cells), ([-1, -3, 0], [6, 4, 5]));
        assert!((large.volume() - 120.0 * 0.24_f64.powi(3)).abs() < 1e-12);
    }

    #[test]
    fn absurd_corners_give_a_box_of_bounded_size() {
        let region = Region::around([f64::NAN, -1e300, 5.0], [f64::INFINITY, 1e300, -5.0]);
        assert_eq!(region.cells, [1, MOST_CELLS, 1]);
    }

    #[test]
    fn rays_leave_through_the_nearest_wall_ahead() {
        let region = Region::around([0.0; 3], [2.4, 2.4, 4.8]);
        let from = Vector3::new(1.2, 1.2, 0.8);
        assert!((region.exit(&from, &Vector3::new(0.0, 0.1, 1.0)) - 4.0).abs() < 1e-12);
        assert!((region.exit(&from, &Vector3::new(0.6, 0.0, 1.0)) - 2.0).abs() < 1e-12);
        assert_eq!(region.exit(&Vector3::new(9.0, 1.0, 1.0), &Vector3::new(1.0, 0.0, 0.0)), 0.0);
    }
}
