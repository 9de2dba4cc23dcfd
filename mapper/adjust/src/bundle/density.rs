//! How many Gaussians there are and where: dividing those that are torn between pixels, removing those that do nothing.

use mba_raster::gaussians::{Gaussian, Gaussians};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::optimiser_state::OptimiserState;

/// Gaussians fainter than this are removed.
const FAINT: f32 = 0.02;
/// Standard deviation in metres above which a Gaussian is removed: no surface of a room is that smooth.
const HUGE: f32 = 1.0;
/// A divided Gaussian's children lie this many standard deviations from its centre along its longest axis.
const OFFSET: f32 = 0.7;
/// Factor on the longest standard deviation of a child.
const SHRINK: f32 = 0.6;

/// Divides up to `room` Gaussians that are pulled, those with the largest first. Returns how many.
pub(super) fn divide(gaussians: &mut Gaussians, optimiser: &mut OptimiserState, room: usize) -> usize {
    let mut torn: Vec<(f32, usize)> = (0..gaussians.len())
        .map(|i| (optimiser.screen_gradient.mean(i), i))
        .filter(|(mean, _)| *mean > 0.0)
        .collect();
    torn.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    torn.truncate(room);
    for &(_, i) in &torn {
        let Some(parent) = gaussians.get(i) else { continue };
        let [one, other] = children(&parent);
        gaussians.set(i, &one);
        gaussians.push(&other);
        optimiser.divided(i);
    }
    torn.len()
}

fn children(parent: &Gaussian) -> [Gaussian; 2] {
    let axis = (0..3).fold(0, |best, k| if parent.log_scale[k] > parent.log_scale[best] { k } else { best });
    let [w, x, y, z] = parent.rotation;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let along = rotation * Vector3::ith(axis, OFFSET * parent.log_scale[axis].exp());
    [-1.0, 1.0].map(|side| {
        let mut child = *parent;
        (0..3).for_each(|k| child.mean[k] += side * along[k]);
        child.log_scale[axis] += SHRINK.ln();
        child
    })
}

/// Removes Gaussians that are faint, huge or not finite. Returns how many.
pub(super) fn prune(gaussians: &mut Gaussians, optimiser: &mut OptimiserState) -> usize {
    let before = gaussians.len();
    let faint = (FAINT / (1.0 - FAINT)).ln();
    let keep: Vec<usize> = (0..before)
        .filter(|&i| {
            gaussians.get(i).is_some_and(|g| {
                let finite = g.to_array().iter().all(|value| value.is_finite());
                let largest = g.log_scale.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                finite && g.opacity_logit >= faint && largest <= HUGE.ln()
            })
        })
        .collect();
    select(gaussians, optimiser, &keep);
    before - keep.len()
}

/// Makes Gaussian `keep[i]` the new Gaussian i; indices beyond the set are left out.
pub(super) fn select(gaussians: &mut Gaussians, optimiser: &mut OptimiserState, keep: &[usize]) {
    *gaussians = gaussians.select(keep);
    optimiser.select(keep);
}

/// Order of the Gaussians along a Z-curve (Morton 1966) through their bounding box, 10 bits per axis: neighbours in
/// space become neighbours in memory.
#[must_use]
pub(super) fn morton_order(gaussians: &Gaussians) -> Vec<usize> {
    let planes = [0, 1, 2].map(|k| &gaussians.planes()[k]);
    let bounds = planes.map(|plane| {
        let finite = plane.iter().copied().filter(|x| x.is_finite());
        let low = finite.clone().fold(f32::INFINITY, f32::min);
        (low, (finite.fold(f32::NEG_INFINITY, f32::max) - low).max(1e-6))
    });
    let code = |i: usize| {
        (0..3).fold(0_u32, |code, k| {
            let (low, extent) = bounds[k];
            // Casts saturate: numbers that are not finite end up at the border.
            code | spread((((planes[k][i] - low) / extent * 1023.0) as u32).min(1023)) << k
        })
    };
    let mut order: Vec<(u32, usize)> = (0..gaussians.len()).map(|i| (code(i), i)).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| i).collect()
}

/// The lowest ten bits, two zeros between each.
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussian(mean: [f32; 3], opacity_logit: f32) -> Gaussian {
        let log_scale = [0.01_f32, 0.1, 0.02].map(f32::ln);
        Gaussian { mean, log_scale, rotation: [1.0, 0.0, 0.0, 0.0], opacity_logit, colour: [0.5; 3] }
    }

    fn optimiser(count: usize) -> OptimiserState {
        let mut optimiser = OptimiserState::default();
        optimiser.append(count, 0);
        optimiser.moments.updates.fill(3);
        optimiser
    }

    #[test]
    fn the_most_torn_is_divided_along_its_longest_axis() {
        let mut map: Gaussians = [0.0, 1.0, 2.0].map(|x| gaussian([x, 0.0, 0.0], 1.0)).into_iter().collect();
        let mut optimiser = optimiser(3);
        // The second is pulled less in all, but only seen once.
        optimiser.screen_gradient.add(&[1.0, 1.8, 0.5], &[true, true, true]);
        optimiser.screen_gradient.add(&[1.0, 9.0, 0.5], &[true, false, true]);
        assert_eq!(divide(&mut map, &mut optimiser, 1), 1);
        assert_eq!((map.len(), optimiser.moments.updates.len()), (4, 4));
        let [one, other] = [1, 3].map(|i| map.get(i).unwrap());
        assert!((one.mean[1] + 0.07).abs() < 1e-6 && (other.mean[1] - 0.07).abs() < 1e-6);
        assert!((one.log_scale[1].exp() - 0.06).abs() < 1e-6 && one.log_scale[0] == 0.01_f32.ln());
        assert_eq!((optimiser.moments.updates[0], optimiser.moments.updates[1]), (3, 0));
    }

    #[test]
    fn faint_huge_and_broken_ones_are_removed() {
        let mut huge = gaussian([0.0; 3], 1.0);
        huge.log_scale[2] = 2.0_f32.ln();
        let mut broken = gaussian([0.0; 3], 1.0);
        broken.colour[1] = f32::NAN;
        let mut map: Gaussians =
            [huge, gaussian([7.0; 3], 0.0), gaussian([0.0; 3], -5.0), broken].into_iter().collect();
        let mut optimiser = optimiser(4);
        assert_eq!(prune(&mut map, &mut optimiser), 3);
        assert_eq!((map.get(0).unwrap().mean, optimiser.moments.updates.len()), ([7.0; 3], 1));
    }

    #[test]
    fn the_curve_keeps_neighbours_together() {
        let map: Gaussians = (0..64).map(|i| gaussian([(i * 37 % 64) as f32, 0.0, 0.0], 1.0)).collect();
        let order = morton_order(&map);
        assert!(order.windows(2).all(|pair| map.planes()[0][pair[0]] < map.planes()[0][pair[1]]));
        assert_eq!(spread(0b11_1111_1111), 0o1_111_111_111);
    }
}
