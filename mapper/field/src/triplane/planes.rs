//! Three axis-aligned planes of features at one resolution.

use mba_io::checkpoint::exact_floats;
use rand_core::Rng;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use super::region::Region;
use super::settings::{CHANNELS, COARSE_CELL};

/// The two axes of each plane: xy, xz and yz. Nodes next to each other along the first are so in memory.
pub(super) const PLANE_AXES: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// Spread of first values: uniform with the deviation of ESLAM's normal distribution, 0.01.
const SPREAD: f32 = 0.017_320_508;

/// Features on the nodes of three planes over a box of space; their sum at a point is the feature there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub(super) struct FeaturePlanes {
    /// Cells along one coarse cell.
    pub(super) refinement: u32,
    /// Nodes along x, y and z: one more than cells.
    pub(super) nodes: [usize; 3],
    /// The planes of [`PLANE_AXES`], [`CHANNELS`] values per node.
    pub(super) values: [PlaneValues; 3],
}

/// All values of a plane; a checkpoint keeps every bit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct PlaneValues(#[serde(with = "exact_floats")] pub(super) Vec<f32>);

/// Planes as they are read, before it is known whether they fit together.
#[derive(Deserialize)]
struct Stored {
    refinement: u32,
    nodes: [usize; 3],
    values: [PlaneValues; 3],
}

impl TryFrom<Stored> for FeaturePlanes {
    type Error = &'static str;

    fn try_from(Stored { refinement, nodes, values }: Stored) -> Result<Self, Self::Error> {
        let fits = |([u, v], plane): ([usize; 2], &PlaneValues)| {
            let count = nodes[u].checked_mul(nodes[v]).and_then(|nodes| nodes.checked_mul(CHANNELS));
            count == Some(plane.0.len())
        };
        if refinement == 0
            || nodes.iter().any(|nodes| *nodes < 2)
            || !PLANE_AXES.into_iter().zip(&values).all(fits)
        {
            return Err("planes do not have the size that they should have");
        }
        Ok(Self { refinement, nodes, values })
    }
}

impl FeaturePlanes {
    /// Planes over `region` with all values zero.
    pub(super) fn zeros(region: &Region, refinement: u32) -> Self {
        let nodes = region.cells.map(|cells| (cells * refinement) as usize + 1);
        let values = PLANE_AXES.map(|[u, v]| PlaneValues(vec![0.0; nodes[u] * nodes[v] * CHANNELS]));
        Self { refinement, nodes, values }
    }

    /// Planes with small random values, which depend on `seed` and on where a node is in the world only.
    pub(super) fn random(region: &Region, refinement: u32, seed: u64) -> Self {
        let mut planes = Self::zeros(region, refinement);
        let first = region.first.map(|cell| i64::from(cell) * i64::from(refinement));
        for (plane, [u, v]) in PLANE_AXES.into_iter().enumerate() {
            let columns = planes.nodes[u];
            for (node, values) in planes.values[plane].0.chunks_exact_mut(CHANNELS).enumerate() {
                let place = [first[u] + (node % columns) as i64, first[v] + (node / columns) as i64];
                let stream = ((place[0] as u64) << 32) ^ (place[1] as u64 & 0xffff_ffff);
                let mut random = Pcg32::new(seed ^ (plane as u64) << 8, stream);
                values.iter_mut().for_each(|value| *value = SPREAD * signed_unit(&mut random));
            }
        }
        planes
    }

    /// Length of a cell, metres.
    pub(super) fn cell(&self) -> f64 {
        COARSE_CELL / f64::from(self.refinement)
    }

    /// Copies the nodes of planes over a smaller box, `inner`, into these over `outer`.
    pub(super) fn copy_from(&mut self, outer: &Region, smaller: &Self, inner: &Region) {
        let shift: [usize; 3] = core::array::from_fn(|axis| {
            (inner.first[axis] - outer.first[axis]).max(0) as usize * self.refinement as usize
        });
        for (plane, [u, v]) in PLANE_AXES.into_iter().enumerate() {
            let row = smaller.nodes[u] * CHANNELS;
            for (y, from) in smaller.values[plane].0.chunks_exact(row).enumerate() {
                let start = ((shift[v] + y) * self.nodes[u] + shift[u]) * CHANNELS;
                if let Some(to) = self.values[plane].0.get_mut(start..start + row) {
                    to.copy_from_slice(from);
                }
            }
        }
    }
}

/// The next number of `random`, in `[-1, 1)`.
pub(super) fn signed_unit(random: &mut Pcg32) -> f32 {
    unit(random) * 2.0 - 1.0
}

/// The next number of `random`, in `[0, 1)`.
pub(super) fn unit(random: &mut Pcg32) -> f32 {
    // As many bits as single precision holds exactly.
    (random.next_u32() >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_has_its_value_wherever_the_box_ends() {
        let inner = Region::around([0.0, 0.24, -0.48], [0.48, 0.96, 0.24]);
        let outer = inner.union(&Region::around([-0.7, 0.0, -1.0], [1.0, 1.0, 1.0]));
        let small = FeaturePlanes::random(&inner, 3, 7);
        let large = FeaturePlanes::random(&outer, 3, 7);
        let mut copied = FeaturePlanes::zeros(&outer, 3);
        copied.copy_from(&outer, &small, &inner);
        for (copied, large) in copied.values.iter().zip(&large.values) {
            let of_small = copied.0.iter().filter(|value| **value != 0.0).count();
            assert!(of_small > 100 && of_small < copied.0.len() / 2, "{of_small} of {}", copied.0.len());
            let agree = copied.0.iter().zip(&large.0).all(|(a, b)| *a == 0.0 || a == b);
            assert!(agree);
        }
    }

    #[test]
    fn first_values_have_the_deviation_of_the_paper() {
        let region = Region::around([0.0; 3], [2.4; 3]);
        let planes = FeaturePlanes::random(&region, 4, 1);
        let values = &planes.values[1].0;
        let square: f64 = values.iter().map(|value| f64::from(value * value)).sum();
        assert!(((square / values.len() as f64).sqrt() - 0.01).abs() < 1e-3);
    }
}
