//! Numbers of a decoder: features to two hidden layers with ReLU to a few outputs.

use mba_io::checkpoint::exact_floats;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use super::planes::signed_unit;
use super::settings::{FEATURES, HIDDEN};

/// Weights of a decoder, or a number for each of them: a gradient, a moment.
///
/// Rows of the hidden layers belong to their inputs, rows of the last one to its outputs: what kernels read together
/// lies together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Flat", try_from = "Flat")]
pub(super) struct Layers<const OUTPUTS: usize> {
    pub(super) first: [[f32; HIDDEN]; FEATURES],
    pub(super) first_bias: [f32; HIDDEN],
    pub(super) second: [[f32; HIDDEN]; HIDDEN],
    pub(super) second_bias: [f32; HIDDEN],
    pub(super) last: [[f32; HIDDEN]; OUTPUTS],
    pub(super) last_bias: [f32; OUTPUTS],
}

impl<const OUTPUTS: usize> Default for Layers<OUTPUTS> {
    fn default() -> Self {
        Self {
            first: [[0.0; HIDDEN]; FEATURES],
            first_bias: [0.0; HIDDEN],
            second: [[0.0; HIDDEN]; HIDDEN],
            second_bias: [0.0; HIDDEN],
            last: [[0.0; HIDDEN]; OUTPUTS],
            last_bias: [0.0; OUTPUTS],
        }
    }
}

impl<const OUTPUTS: usize> Layers<OUTPUTS> {
    /// Number of values.
    pub(super) const COUNT: usize =
        FEATURES * HIDDEN + HIDDEN + HIDDEN * HIDDEN + HIDDEN + OUTPUTS * HIDDEN + OUTPUTS;

    /// Uniform random weights and biases within one over the root of the number of inputs.
    pub(super) fn random(random: &mut Pcg32) -> Self {
        let mut layers = Self::default();
        let [hidden, others] = [FEATURES, HIDDEN].map(|inputs| 1.0 / (inputs as f32).sqrt());
        for (part, values) in layers.parts_mut().into_iter().enumerate() {
            let bound = if part < 2 { hidden } else { others };
            values.iter_mut().for_each(|value| *value = bound * signed_unit(random));
        }
        layers
    }

    /// All values, layer by layer: weights, then biases.
    pub(super) fn parts(&self) -> [&[f32]; 6] {
        [
            self.first.as_flattened(),
            &self.first_bias,
            self.second.as_flattened(),
            &self.second_bias,
            self.last.as_flattened(),
            &self.last_bias,
        ]
    }

    /// As [`Self::parts`].
    pub(super) fn parts_mut(&mut self) -> [&mut [f32]; 6] {
        [
            self.first.as_flattened_mut(),
            &mut self.first_bias,
            self.second.as_flattened_mut(),
            &mut self.second_bias,
            self.last.as_flattened_mut(),
            &mut self.last_bias,
        ]
    }

    /// Adds all values of `other`.
    pub(super) fn add(&mut self, other: &Self) {
        for (sums, values) in self.parts_mut().into_iter().zip(other.parts()) {
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
    }

    /// All values in the order of [`Self::parts`].
    pub(super) fn to_vec(&self) -> Vec<f32> {
        self.parts().concat()
    }

    /// The inverse of [`Self::to_vec`], or `None` for another number of values.
    pub(super) fn from_slice(mut values: &[f32]) -> Option<Self> {
        if values.len() != Self::COUNT {
            return None;
        }
        let mut layers = Self::default();
        for part in layers.parts_mut() {
            let (own, rest) = values.split_at(part.len());
            part.copy_from_slice(own);
            values = rest;
        }
        Some(layers)
    }
}

/// All values in a row, as they are stored.
#[derive(Serialize, Deserialize)]
struct Flat(#[serde(with = "exact_floats")] Vec<f32>);

impl<const OUTPUTS: usize> From<Layers<OUTPUTS>> for Flat {
    fn from(layers: Layers<OUTPUTS>) -> Self {
        Self(layers.to_vec())
    }
}

impl<const OUTPUTS: usize> TryFrom<Flat> for Layers<OUTPUTS> {
    type Error = &'static str;

    fn try_from(flat: Flat) -> Result<Self, Self::Error> {
        Self::from_slice(&flat.0).ok_or("a decoder has another number of weights")
    }
}
