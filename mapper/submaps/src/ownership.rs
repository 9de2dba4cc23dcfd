//! Which Gaussians of a group stay: each belongs to the group whose keyframe sees it nearest and most frontally.
//!
//! Who sees a place best follows from the place, not from the map that a Gaussian is in: where two groups have mapped the same
//! surface, one of the two stays.

use mba_raster::gaussians::{Gaussian, Gaussians};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::depth_of_keyframe::DepthView;

/// Least cosine of the angle between the line of sight and the normal that counts: what is flatter is not seen worse.
const FLATTEST: f64 = 0.5;

/// Gaussians of one group, and which group sees each best so far.
pub(crate) struct Ownership {
    places: Vec<Place>,
    bounds: [Vector3<f64>; 2],
}

struct Place {
    mean: Vector3<f64>,
    normal: Vector3<f64>,
    /// The least distance over cosine so far, metres, and whose that is.
    best: Option<(f64, usize)>,
}

impl Ownership {
    /// Of a map in the world of all.
    pub(crate) fn new(map: &Gaussians) -> Self {
        let places: Vec<Place> = (0..map.len()).filter_map(|k| map.get(k)).map(place).collect();
        let bound = |pick: fn(f64, f64) -> f64, start: f64| {
            let means = places.iter().map(|place| place.mean);
            means.fold(Vector3::repeat(start), |bound, mean| bound.zip_map(&mean, pick))
        };
        let bounds = [bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY)];
        Self { places, bounds }
    }

    /// Distance in metres from a point to the box around all Gaussians.
    pub(crate) fn distance_from(&self, point: &Vector3<f64>) -> f64 {
        let [low, high] = &self.bounds;
        Vector3::from_fn(|axis, _| (low[axis] - point[axis]).max(point[axis] - high[axis]).max(0.0)).norm()
    }

    /// Takes in what a keyframe of group `owner` sees. Equal views are decided by the order of the calls.
    pub(crate) fn see(&mut self, view: &DepthView, owner: usize) {
        self.places.par_iter_mut().for_each(|place| {
            let Some(distance) = view.distance(&place.mean) else { return };
            // The nearest and least oblique view knows most of a surface: pixels on it grow with distance over cosine.
            let cosine = view.direction(&place.mean).dot(&place.normal).abs().max(FLATTEST);
            let score = distance / cosine;
            if place.best.is_none_or(|(best, _)| score < best) {
                place.best = Some((score, owner));
            }
        });
    }

    /// Indices of the Gaussians that stay in the map of group `owner`: those that nobody sees stay, too.
    pub(crate) fn kept_by(&self, owner: usize) -> Vec<usize> {
        let is_kept = |place: &Place| place.best.is_none_or(|(_, best)| best == owner);
        (0..self.places.len()).filter(|&k| is_kept(&self.places[k])).collect()
    }
}

/// Centre and normal of a Gaussian: the shortest of its axes.
fn place(gaussian: Gaussian) -> Place {
    let [w, x, y, z] = gaussian.rotation.map(f64::from);
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let shortest =
        (0..3).min_by(|&a, &b| gaussian.log_scale[a].total_cmp(&gaussian.log_scale[b])).unwrap_or(0);
    let axis = Vector3::from_fn(|row, _| if row == shortest { 1.0 } else { 0.0 });
    Place { mean: Vector3::from(gaussian.mean).map(f64::from), normal: rotation * axis, best: None }
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::{PinholeCamera, RigidTransform};

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 40, height: 30, fx: 20.0, fy: 20.0, cx: 19.5, cy: 14.5 };

    /// A disc at `x` on a wall at z = 2, or nearer.
    fn disc(x: f32, z: f32) -> Gaussian {
        let (rotation, log_scale) = ([1.0, 0.0, 0.0, 0.0], [-4.0, -4.0, -7.0]);
        Gaussian { mean: [x, 0.0, z], rotation, log_scale, ..Gaussian::default() }
    }

    /// A camera at a place that looks along z at the wall.
    fn view(x: f64, z: f64) -> DepthView {
        let place = RigidTransform { translation: Vector3::new(x, 0.0, z), ..RigidTransform::identity() };
        DepthView::of_wall(&CAMERA, &place, 2.0 - z)
    }

    #[test]
    fn a_surface_stays_where_it_is_seen_nearest_and_most_frontally() {
        // In the middle of both, nearer to the second, in view of the first only, hidden from both, and out of sight.
        let discs = [disc(0.1, 2.0), disc(0.5, 2.0), disc(-1.5, 2.0), disc(0.0, 2.5), disc(9.0, 2.0)];
        let map: Gaussians = discs.into_iter().collect();
        let kept = |owners: [usize; 2]| {
            let mut ownership = Ownership::new(&map);
            let views = [view(0.0, 0.0), view(0.5, 1.0)];
            for (view, owner) in views.iter().zip(owners) {
                ownership.see(view, owner);
            }
            [ownership.kept_by(0), ownership.kept_by(1)]
        };
        // The second camera is a metre from the wall, and sees as far as x = -0.5 on it.
        assert_eq!(kept([0, 1]), [vec![2, 3, 4], vec![0, 1, 3, 4]]);
        assert_eq!(kept([1, 1]), [vec![3, 4], vec![0, 1, 2, 3, 4]]);
        let ownership = Ownership::new(&map);
        assert_eq!(ownership.distance_from(&Vector3::new(-2.5, 0.0, 2.2)), 1.0);
        assert_eq!(ownership.distance_from(&Vector3::new(3.0, 0.0, 2.2)), 0.0);
    }

    #[test]
    fn of_two_at_the_same_distance_the_one_in_front_wins() {
        let map: Gaussians = [disc(0.0, 2.0)].into_iter().collect();
        let mut ownership = Ownership::new(&map);
        // 2.06 m away, at a slant; then straight on, and a little further.
        ownership.see(&view(1.2, 0.325), 0);
        ownership.see(&view(0.0, -0.1), 1);
        assert_eq!((ownership.kept_by(0).len(), ownership.kept_by(1).len()), (0, 1));
    }
}
