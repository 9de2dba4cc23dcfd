//! Decoders on many samples: units of a layer in lanes, four samples at a time, so that a row of weights is read once
//! for four.

use fearless_simd::{f32x16, prelude::*};

use super::layers::Layers;
use super::settings::{FEATURES, HIDDEN};

/// Samples at a time; buffers are padded to whole blocks.
pub(super) const BLOCK: usize = 4;

/// One value per hidden unit.
pub(super) type Units = [f32; HIDDEN];

/// What a decoder made of its samples; the backward pass needs all of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Activations<const OUTPUTS: usize> {
    /// Inputs, per sample.
    pub(super) features: Vec<[f32; FEATURES]>,
    /// Hidden layers after ReLU.
    pub(super) hidden: [Vec<Units>; 2],
    /// Outputs, before their activation.
    pub(super) outputs: Vec<[f32; OUTPUTS]>,
}

impl<const OUTPUTS: usize> Activations<OUTPUTS> {
    /// Makes room for `samples`, padded to whole blocks with features that are zero.
    pub(super) fn resize(&mut self, samples: usize) {
        let padded = samples.next_multiple_of(BLOCK);
        self.features.resize(padded, [0.0; FEATURES]);
        self.features[samples..].fill([0.0; FEATURES]);
        self.hidden.iter_mut().for_each(|layer| layer.resize(padded, [0.0; HIDDEN]));
        self.outputs.resize(padded, [0.0; OUTPUTS]);
    }
}

/// Computes hidden layers and outputs from the features.
#[inline(always)]
pub(super) fn decode<S: Simd, const OUTPUTS: usize>(
    simd: S,
    layers: &Layers<OUTPUTS>,
    samples: &mut Activations<OUTPUTS>,
) {
    let [hidden_1, hidden_2] = &mut samples.hidden;
    let features = samples.features.as_chunks::<BLOCK>().0.iter();
    let hidden_1 = hidden_1.as_chunks_mut::<BLOCK>().0.iter_mut();
    let hidden_2 = hidden_2.as_chunks_mut::<BLOCK>().0.iter_mut();
    let outputs = samples.outputs.as_chunks_mut::<BLOCK>().0.iter_mut();
    for (((features, hidden_1), hidden_2), outputs) in features.zip(hidden_1).zip(hidden_2).zip(outputs) {
        hidden_layer(simd, &layers.first, &layers.first_bias, features, hidden_1);
        hidden_layer(simd, &layers.second, &layers.second_bias, hidden_1, hidden_2);
        for (hidden, outputs) in hidden_2.iter().zip(outputs) {
            let hidden = f32x16::load_array_ref(simd, hidden);
            for (output, (row, bias)) in outputs.iter_mut().zip(layers.last.iter().zip(&layers.last_bias)) {
                *output = (hidden * f32x16::load_array_ref(simd, row)).reduce_sum() + bias;
            }
        }
    }
}

/// One layer of a block of samples: `max(0, W x + b)`.
#[inline(always)]
fn hidden_layer<S: Simd, const INPUTS: usize>(
    simd: S,
    weights: &[Units; INPUTS],
    bias: &Units,
    inputs: &[[f32; INPUTS]; BLOCK],
    out: &mut [Units; BLOCK],
) {
    let sums = multiply(simd, weights, f32x16::load_array_ref(simd, bias), inputs);
    for (sum, out) in sums.into_iter().zip(out) {
        sum.max(0.0).store_array(out);
    }
}

/// `start + rows^T x` of every sample of a block.
#[inline(always)]
pub(super) fn multiply<S: Simd, const INPUTS: usize>(
    simd: S,
    rows: &[Units; INPUTS],
    start: f32x16<S>,
    inputs: &[[f32; INPUTS]; BLOCK],
) -> [f32x16<S>; BLOCK] {
    let mut sums = [start; BLOCK];
    for (i, row) in rows.iter().enumerate() {
        let row = f32x16::load_array_ref(simd, row);
        for (sum, input) in sums.iter_mut().zip(inputs) {
            *sum = row.mul_add(input[i], *sum);
        }
    }
    sums
}
