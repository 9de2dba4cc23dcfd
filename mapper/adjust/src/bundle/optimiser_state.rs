//! What is kept of every Gaussian besides its parameters.

use mba_io::checkpoint::exact_floats;
use mba_raster::gaussians::Gaussian;
use serde::{Deserialize, Serialize};

use super::adam::Moments;

/// One entry per Gaussian of the map, in the map's order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct OptimiserState {
    /// Moments of the gradients.
    pub(super) moments: Moments,
    /// Screen gradients since the last change of density.
    pub(super) screen_gradient: ScreenGradient,
    /// The keyframe that each was seeded from, by its index in the data set. Children have their parent's.
    pub(super) origins: Vec<u32>,
}

/// Mean length of the gradient by the projected centre of every Gaussian, since the last change of density.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct ScreenGradient {
    /// Sum of lengths of gradients by the projected centre.
    #[serde(with = "exact_floats")]
    sum: Vec<f32>,
    /// Number of exposures that drew it.
    drawn: Vec<u32>,
}

impl ScreenGradient {
    /// Adds those of an exposure.
    pub(super) fn add(&mut self, screen: &[f32], is_drawn: &[bool]) {
        let own = self.sum.iter_mut().zip(&mut self.drawn);
        for ((sum, drawn), (screen, _)) in own.zip(screen.iter().zip(is_drawn)).filter(|(_, (_, is))| **is) {
            *sum += screen;
            *drawn += 1;
        }
    }

    /// Mean over the exposures that drew Gaussian `i`; 0 without any.
    pub(super) fn mean(&self, i: usize) -> f32 {
        if self.drawn[i] == 0 { 0.0 } else { self.sum[i] / self.drawn[i] as f32 }
    }

    fn resize(&mut self, count: usize) {
        self.sum.resize(count, 0.0);
        self.drawn.resize(count, 0);
    }
}

impl OptimiserState {
    /// Entries for new Gaussians at the end of a map that now has `count`, seeded from keyframe `origin`.
    pub(super) fn append(&mut self, count: usize, origin: usize) {
        self.moments.first.resize(count);
        self.moments.second.resize(count);
        self.moments.updates.resize(count, 0);
        self.screen_gradient.resize(count);
        self.origins.resize(count, u32::try_from(origin).unwrap_or(u32::MAX));
    }

    /// Gaussian `i` was divided: it starts without moments, and a sibling was appended to the map.
    pub(super) fn divided(&mut self, i: usize) {
        self.moments.first.set(i, &Gaussian::default());
        self.moments.second.set(i, &Gaussian::default());
        self.moments.updates[i] = 0;
        let origin = self.origins[i];
        self.append(self.origins.len() + 1, origin as usize);
    }

    /// Makes entry `keep[i]` the new entry i; indices beyond the end are left out. The pulls start anew.
    pub(super) fn select(&mut self, keep: &[usize]) {
        self.moments.first = self.moments.first.select(keep);
        self.moments.second = self.moments.second.select(keep);
        self.moments.updates = picked(&self.moments.updates, keep);
        self.origins = picked(&self.origins, keep);
        self.screen_gradient = ScreenGradient::default();
        self.screen_gradient.resize(self.origins.len());
    }
}

fn picked(values: &[u32], keep: &[usize]) -> Vec<u32> {
    keep.iter().filter_map(|&i| values.get(i).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_follow_their_gaussians() {
        let mut optimiser = OptimiserState::default();
        optimiser.append(2, 7);
        optimiser.append(3, 9);
        optimiser.moments.updates = vec![4, 5, 6];
        optimiser.divided(1);
        assert_eq!(
            (&optimiser.origins[..], &optimiser.moments.updates[..]),
            (&[7, 7, 9, 7][..], &[4, 0, 6, 0][..])
        );
        optimiser.screen_gradient.add(&[1.0; 4], &[true; 4]);
        optimiser.select(&[2, 0]);
        assert_eq!((&optimiser.origins[..], &optimiser.moments.updates[..]), (&[9, 7][..], &[6, 4][..]));
        assert_eq!((optimiser.moments.first.len(), optimiser.screen_gradient.mean(1)), (2, 0.0));
    }
}
