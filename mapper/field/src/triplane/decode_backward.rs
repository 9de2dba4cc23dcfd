//! Gradients of decoders: by their features and by their weights.

use fearless_simd::{f32x16, prelude::*};

use super::decode::{Activations, BLOCK, Units, multiply};
use super::layers::Layers;
use super::settings::{FEATURES, HIDDEN};

/// Samples whose gradients by hidden units are kept at a time.
const TILE: usize = 32;

/// Features in vectors of sixteen.
const FEATURE_ROWS: usize = FEATURES / HIDDEN;

/// Weights of a decoder with rows for the outputs of its hidden layers.
#[derive(Clone, Debug)]
pub(super) struct Transposed {
    first: [[Units; HIDDEN]; FEATURE_ROWS],
    second: [Units; HIDDEN],
}

impl Transposed {
    pub(super) fn new<const OUTPUTS: usize>(layers: &Layers<OUTPUTS>) -> Self {
        let unit = |output: usize| move |row: &Units| row[output];
        let first = core::array::from_fn(|part| {
            core::array::from_fn(|output| {
                core::array::from_fn(|input| unit(output)(&layers.first[part * HIDDEN + input]))
            })
        });
        let second = core::array::from_fn(|output| layers.second.each_ref().map(unit(output)));
        Self { first, second }
    }
}

/// Gradients by the hidden units of a tile.
struct Tile {
    first: [Units; TILE],
    second: [Units; TILE],
}

/// Adds the gradient by the weights to `grad_layers` and stores that by the features, given the one by the outputs before
/// their activation. All buffers have the padded length of `samples`.
#[inline(always)]
pub(super) fn decode_backward<S: Simd, const OUTPUTS: usize>(
    simd: S,
    layers: &Layers<OUTPUTS>,
    transposed: &Transposed,
    samples: &Activations<OUTPUTS>,
    grad_outputs: &[[f32; OUTPUTS]],
    grad_features: &mut [[f32; FEATURES]],
    grad_layers: &mut Layers<OUTPUTS>,
) {
    let mut tile = Tile { first: [[0.0; HIDDEN]; TILE], second: [[0.0; HIDDEN]; TILE] };
    let mut start = 0;
    while start < grad_outputs.len() {
        let range = start..(start + TILE).min(grad_outputs.len());
        let count = range.len();
        // Gradients of a tile go from the outputs to the features and stay in the first cache on the way.
        let hidden = samples.hidden.each_ref().map(|layer| &layer[range.clone()]);
        let grad_outputs = &grad_outputs[range.clone()];
        // Through the layers, the last one first.
        last_layer(simd, layers, hidden[1], grad_outputs, &mut tile.second, grad_layers);
        through(simd, &transposed.second, hidden[0], &tile.second, &mut tile.first);
        to_features(simd, transposed, &tile.first, &mut grad_features[range.clone()]);
        grad_weights(
            simd,
            hidden[0],
            &tile.second[..count],
            &mut grad_layers.second,
            &mut grad_layers.second_bias,
        );
        // The weights of a layer get the products of its inputs with the gradient by its sums.
        let features = &samples.features[range];
        grad_weights(
            simd,
            features,
            &tile.first[..count],
            &mut grad_layers.first,
            &mut grad_layers.first_bias,
        );
        start += TILE;
    }
}

/// Through the last layer: stores the gradient by the sums of the second hidden layer, adds that by the weights.
#[inline(always)]
fn last_layer<S: Simd, const OUTPUTS: usize>(
    simd: S,
    layers: &Layers<OUTPUTS>,
    hidden: &[Units],
    grad_outputs: &[[f32; OUTPUTS]],
    out: &mut [Units; TILE],
    grad_layers: &mut Layers<OUTPUTS>,
) {
    let zero = f32x16::splat(simd, 0.0);
    for (output, row) in layers.last.iter().enumerate() {
        let row = f32x16::load_array_ref(simd, row);
        let mut sum = f32x16::load_array_ref(simd, &grad_layers.last[output]);
        for ((hidden, grad_outputs), out) in hidden.iter().zip(grad_outputs).zip(&mut *out) {
            let hidden = f32x16::load_array_ref(simd, hidden);
            sum = hidden.mul_add(grad_outputs[output], sum);
            grad_layers.last_bias[output] += grad_outputs[output];
            // The first output overwrites what an earlier tile left.
            let before = if output == 0 { zero } else { f32x16::load_array_ref(simd, out) };
            let grad_hidden = row.mul_add(grad_outputs[output], before);
            // The derivative of max(0, x): what was off passes nothing on.
            hidden.simd_gt(0.0).select(grad_hidden, zero).store_array(out);
        }
        sum.store_array(&mut grad_layers.last[output]);
    }
}

/// Through a hidden layer to the sums of the one before it, of which `hidden` are the outputs.
#[inline(always)]
fn through<S: Simd>(
    simd: S,
    rows: &[Units; HIDDEN],
    hidden: &[Units],
    grad_sums: &[Units; TILE],
    out: &mut [Units; TILE],
) {
    let zero = f32x16::splat(simd, 0.0);
    let blocks = grad_sums.as_chunks::<BLOCK>().0.iter().zip(out.as_chunks_mut::<BLOCK>().0);
    for (hidden, (grad_sums, out)) in hidden.as_chunks::<BLOCK>().0.iter().zip(blocks) {
        let products = multiply(simd, rows, zero, grad_sums);
        for ((product, hidden), out) in products.into_iter().zip(hidden).zip(out) {
            // As above, what was off passes nothing on.
            let active = f32x16::load_array_ref(simd, hidden).simd_gt(0.0);
            active.select(product, zero).store_array(out);
        }
    }
}

/// Through the first layer to the features.
#[inline(always)]
fn to_features<S: Simd>(
    simd: S,
    transposed: &Transposed,
    grad_sums: &[Units; TILE],
    out: &mut [[f32; FEATURES]],
) {
    let zero = f32x16::splat(simd, 0.0);
    for (out, grad_sums) in out.as_chunks_mut::<BLOCK>().0.iter_mut().zip(grad_sums.as_chunks::<BLOCK>().0) {
        for (part, rows) in transposed.first.iter().enumerate() {
            let products = multiply(simd, rows, zero, grad_sums);
            for (product, out) in products.into_iter().zip(&mut *out) {
                product.store_slice(&mut out[part * HIDDEN..(part + 1) * HIDDEN]);
            }
        }
    }
}

/// Adds the gradient by weights and biases of a layer: sums stay in registers over all samples.
#[inline(always)]
fn grad_weights<S: Simd, const INPUTS: usize>(
    simd: S,
    inputs: &[[f32; INPUTS]],
    grad_sums: &[Units],
    out: &mut [Units; INPUTS],
    grad_bias: &mut Units,
) {
    // The bias has an input of one.
    let mut bias = f32x16::load_array_ref(simd, grad_bias);
    for grad_sums in grad_sums {
        bias += f32x16::load_array_ref(simd, grad_sums);
    }
    bias.store_array(grad_bias);
    for (part, rows) in out.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
        let first = part * BLOCK;
        let mut sums = [f32x16::splat(simd, 0.0); BLOCK];
        for (inputs, grad_sums) in inputs.iter().zip(grad_sums) {
            let grad_sums = f32x16::load_array_ref(simd, grad_sums);
            for (sum, input) in sums.iter_mut().zip(&inputs[first..first + BLOCK]) {
                *sum = grad_sums.mul_add(*input, *sum);
            }
        }
        for (sum, row) in sums.into_iter().zip(rows) {
            (sum + f32x16::load_array_ref(simd, row)).store_array(row);
        }
    }
}
