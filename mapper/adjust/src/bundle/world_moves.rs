//! How parts of the world move, and Gaussians that move with theirs.

use mba_tracker::geometry::RigidTransform;
use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};

use mba_raster::gaussians::{Gaussian, Gaussians};

/// How parts of the world move: `new_world_from_world` by index in the data set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorldMoves {
    /// Ascending by index.
    moves: Vec<(usize, RigidTransform)>,
}

impl WorldMoves {
    /// Adds the move of the keyframe `index`, which is after all others.
    pub(super) fn push(&mut self, index: usize, new_world_from_world: RigidTransform) {
        self.moves.push((index, new_world_from_world));
    }

    /// The move of what belongs to frame `index`: that of the keyframe next to it in time.
    #[must_use]
    pub fn of(&self, index: usize) -> RigidTransform {
        let next = self.moves.partition_point(|(keyframe, _)| *keyframe < index);
        let around =
            [next.checked_sub(1), Some(next)].into_iter().flatten().filter_map(|k| self.moves.get(k));
        around
            .min_by_key(|(keyframe, _)| keyframe.abs_diff(index))
            .map_or_else(RigidTransform::identity, |(_, by)| *by)
    }

    /// The move of the last keyframe.
    #[must_use]
    pub fn last(&self) -> RigidTransform {
        self.moves.last().map_or_else(RigidTransform::identity, |(_, by)| *by)
    }
}

pub(super) fn move_gaussians(gaussians: &mut Gaussians, origins: &[u32], moves: &WorldMoves) {
    for (i, origin) in origins.iter().enumerate() {
        if let Some(gaussian) = gaussians.get(i) {
            gaussians.set(i, &moved_gaussian(&gaussian, &moves.of(*origin as usize)));
        }
    }
}

/// A Gaussian that moves with its part of the world.
#[must_use]
pub fn moved_gaussian(gaussian: &Gaussian, new_world_from_world: &RigidTransform) -> Gaussian {
    let [w, x, y, z] = gaussian.rotation.map(f64::from);
    let turned = new_world_from_world.rotation * UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let mean = Point3::from(gaussian.mean).map(f64::from).coords;
    let mean: Vector3<f32> = new_world_from_world.transform_point(&mean).map(|x| x as f32);
    Gaussian {
        mean: mean.into(),
        rotation: [turned.w, turned.i, turned.j, turned.k].map(|q| q as f32),
        ..*gaussian
    }
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::so3;

    use super::*;

    fn shift(x: f64) -> RigidTransform {
        RigidTransform { translation: Vector3::new(x, 0.0, 0.0), ..RigidTransform::identity() }
    }

    #[test]
    fn what_lies_between_keyframes_moves_with_the_nearer() {
        let moves = WorldMoves { moves: vec![(3, shift(0.0)), (10, shift(1.0)), (12, shift(2.0))] };
        assert_eq!([0, 5, 8, 11, 40].map(|index| moves.of(index).translation.x), [0.0, 0.0, 1.0, 1.0, 2.0]);
        assert_eq!((moves.last(), WorldMoves::default().of(7)), (shift(2.0), RigidTransform::identity()));
    }

    #[test]
    fn a_gaussian_turns_with_its_part_of_the_world() {
        let quarter = so3::exp(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        let moves = WorldMoves {
            moves: vec![
                (0, RigidTransform::identity()),
                (9, RigidTransform::new(quarter, Vector3::new(0.0, 0.0, 5.0))),
            ],
        };
        let gaussian =
            Gaussian { mean: [1.0, 0.0, 0.0], rotation: [1.0, 0.0, 0.0, 0.0], ..Gaussian::default() };
        let mut map: Gaussians = [gaussian, gaussian].into_iter().collect();
        move_gaussians(&mut map, &[1, 8], &moves);
        assert_eq!(map.get(0), Some(gaussian));
        let turned = map.get(1).unwrap();
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let difference = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>();
        assert!(difference(&turned.mean, &[0.0, 1.0, 5.0]) < 1e-6, "{:?}", turned.mean);
        assert!(difference(&turned.rotation, &[half, 0.0, 0.0, half]) < 1e-6, "{:?}", turned.rotation);
    }
}
