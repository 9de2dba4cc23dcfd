//! Gradients of a loss by all that a field has.

use fearless_simd::dispatch;
use rayon::prelude::*;

use super::cells::Points;
use super::field::TriplaneField;
use super::layers::Layers;
use super::planes::FeaturePlanes;
use super::prepared::Prepared;
use super::scatter::{PlaneSums, nodes_of_cells, sums_of_plane};
use super::settings::{CHANNELS, FEATURES};

/// Planes of a field: geometry coarse, geometry fine, colour coarse, colour fine, each xy, xz and yz.
pub(super) const PLANES: usize = 12;

/// Gradient by one plane.
#[derive(Clone, Debug, Default)]
pub(super) struct PlaneGradient {
    /// A number per value; those of nodes that are not touched are zero.
    pub(super) sums: Vec<f32>,
    /// A bit per node.
    pub(super) touched: Vec<u64>,
}

/// Gradients by a field. An optimiser leaves the planes' zero behind.
#[derive(Clone, Debug, Default)]
pub struct FieldGradients {
    pub(super) planes: [PlaneGradient; PLANES],
    pub(super) distance_decoder: Layers<1>,
    pub(super) colour_decoder: Layers<3>,
    pub(super) log_sharpness: f32,
}

/// A group of samples: where they are, and gradients by their features.
pub(super) type Group<'a> = (Points<'a>, &'a [[f32; FEATURES]]);

impl FieldGradients {
    /// Sets all gradients to zero, and makes them as large as `field`.
    pub(super) fn reset(&mut self, field: &TriplaneField) {
        for (gradient, values) in self.planes.iter_mut().zip(plane_values(field)) {
            gradient.clear();
            gradient.sums.resize(values.len(), 0.0);
            gradient.touched.resize((values.len() / CHANNELS).div_ceil(64), 0);
        }
        (self.distance_decoder, self.colour_decoder) = (Layers::default(), Layers::default());
        self.log_sharpness = 0.0;
    }

    /// Adds the gradients by the planes. Every plane adds up the samples in their order, whatever the number of threads.
    /// Once after a reset.
    pub(super) fn add_planes(&mut self, field: &Prepared<'_>, geometry: &[Group<'_>], colour: &[Group<'_>]) {
        let (sets, _) = self.planes.as_chunks_mut::<3>();
        let heads = [(&field.geometry.planes, geometry), (&field.colour.planes, colour)];
        let mut tasks = Vec::with_capacity(PLANES / 2);
        for ([coarse, fine], (levels, groups)) in sets.as_chunks_mut::<2>().0.iter_mut().zip(heads) {
            let pairs = coarse.iter_mut().zip(fine).enumerate();
            tasks.extend(pairs.map(|(plane, (coarse, fine))| (plane, [coarse, fine], levels, groups)));
        }
        tasks.into_par_iter().for_each(|(plane, mut out, levels, groups)| {
            let mut sums = out.each_mut().map(|out| PlaneSums { sums: &mut out.sums, cells: &mut out.touched });
            for (points, grad_features) in groups {
                dispatch!(field.level, simd => sums_of_plane(simd, levels, plane, *points, grad_features, &mut sums));
            }
            let pairs = out.into_iter().zip(levels);
            pairs.for_each(|(out, planes)| nodes_of_cells(&mut out.touched, planes.columns(plane)));
        });
    }
}

impl PlaneGradient {
    /// Sets what was touched to zero.
    pub(super) fn clear(&mut self) {
        let Self { sums, touched } = self;
        for_each_touched(touched, |node| sums[node * CHANNELS..(node + 1) * CHANNELS].fill(0.0));
        touched.fill(0);
    }
}

/// Calls `visit` with every node whose bit is set, in ascending order.
#[inline(always)]
pub(super) fn for_each_touched(touched: &[u64], mut visit: impl FnMut(usize)) {
    for (word, bits) in touched.iter().enumerate() {
        let mut bits = *bits;
        while bits != 0 {
            visit(word * 64 + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}

/// The values of all planes of a field in the order of [`PLANES`].
fn plane_values(field: &TriplaneField) -> impl Iterator<Item = &[f32]> {
    field.geometry.iter().chain(&field.colour).flat_map(|set| set.values.iter().map(|plane| &*plane.0))
}

/// As [`plane_values`], to be changed.
pub(super) fn plane_values_mut(field: &mut TriplaneField) -> [&mut [f32]; PLANES] {
    let [a, b] = field.geometry.each_mut();
    let [c, d] = field.colour.each_mut();
    let [a, b, c, d] = [a, b, c, d].map(|set: &mut FeaturePlanes| set.values.each_mut());
    let ([a, b, c], [d, e, f], [g, h, i], [j, k, l]) = (a, b, c, d);
    [a, b, c, d, e, f, g, h, i, j, k, l].map(|plane| plane.0.as_mut_slice())
}
