//! How many Gaussians there are and where: dividing those that are torn between pixels, removing those that do nothing.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::adam::Moments;
use crate::gaussians::{Gaussian, Gaussians};

/// Gaussians fainter than this are removed.
const FAINT: f32 = 0.02;
/// Standard deviation in metres above which a Gaussian is removed: no surface of a room is that smooth.
const HUGE: f32 = 1.0;
/// A divided Gaussian's children lie this many standard deviations from its centre along its longest axis.
const OFFSET: f32 = 0.7;
/// Factor on the longest standard deviation of a child.
const SHRINK: f32 = 0.6;

/// How strongly the views pull at every Gaussian, since the last change of density.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pull {
    /// Sum of lengths of gradients by the projected centre.
    pub sum: Vec<f32>,
    /// Number of exposures that drew it.
    pub drawn: Vec<u32>,
}

impl Pull {
    /// No pull on `count` Gaussians.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self { sum: vec![0.0; count], drawn: vec![0; count] }
    }

    /// Adds the pulls of an exposure.
    pub fn add(&mut self, screen: &[f32], is_drawn: impl Fn(usize) -> bool) {
        for (i, (sum, drawn)) in self.sum.iter_mut().zip(&mut self.drawn).enumerate() {
            if is_drawn(i) {
                *sum += screen[i];
                *drawn += 1;
            }
        }
    }

    fn mean(&self, i: usize) -> f32 {
        if self.drawn[i] == 0 { 0.0 } else { self.sum[i] / self.drawn[i] as f32 }
    }
}

/// Divides up to `room` Gaussians whose mean pull exceeds `threshold`, those with the largest first. Returns how many.
pub fn divide(
    gaussians: &mut Gaussians,
    moments: &mut Moments,
    pull: &Pull,
    threshold: f32,
    room: usize,
) -> usize {
    let mut torn: Vec<(f32, usize)> = (0..gaussians.len())
        .map(|i| (pull.mean(i), i))
        .filter(|(mean, _)| *mean > threshold)
        .collect();
    torn.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    torn.truncate(room);
    for &(_, i) in &torn {
        let Some(parent) = gaussians.get(i) else { continue };
        let [one, other] = children(&parent);
        gaussians.set(i, &one);
        gaussians.push(&other);
        forget(moments, i);
    }
    resize(moments, gaussians.len());
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
pub fn prune(gaussians: &mut Gaussians, moments: &mut Moments) -> usize {
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
    select(gaussians, moments, &keep);
    before - keep.len()
}

/// Makes Gaussian `keep[i]` the new Gaussian i; indices beyond the set are left out.
pub fn select(gaussians: &mut Gaussians, moments: &mut Moments, keep: &[usize]) {
    let pick = |set: &Gaussians| keep.iter().filter_map(|&i| set.get(i)).collect::<Gaussians>();
    *gaussians = pick(gaussians);
    moments.first = pick(&moments.first);
    moments.second = pick(&moments.second);
    moments.updates = keep.iter().filter_map(|&i| moments.updates.get(i).copied()).collect();
}

/// Order of the Gaussians along a Z-curve (Morton 1966) through their bounding box, 10 bits per axis: neighbours in
/// space become neighbours in memory.
#[must_use]
pub fn morton_order(gaussians: &Gaussians) -> Vec<usize> {
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

/// A Gaussian that was changed at one go starts without moments.
fn forget(moments: &mut Moments, i: usize) {
    moments.first.set(i, &Gaussian::default());
    moments.second.set(i, &Gaussian::default());
    moments.updates[i] = 0;
}

/// Makes room for the moments of `count` Gaussians.
pub fn resize(moments: &mut Moments, count: usize) {
    moments.first.resize(count);
    moments.second.resize(count);
    moments.updates.resize(count, 0);
}
