//! A field in the form in which kernels read it.

use fearless_simd::{Level, dispatch, f32x8, prelude::*};
use mba_raster::raster::exp::exp;
use nalgebra::Vector3;

use super::cells::{PlanesView, Points};
use super::decode::{Activations, decode};
use super::decode_backward::{Transposed, decode_backward};
use super::encode::{encode, grad_points};
use super::field::TriplaneField;
use super::layers::Layers;
use super::opacity::{Opacity, opacity};
use super::settings::FEATURES;

/// Lanes of the activations.
const LANES: usize = 8;

/// Planes and decoder of geometry or of colour.
#[derive(Debug)]
pub(super) struct Head<'a, const OUTPUTS: usize> {
    pub(super) planes: [PlanesView<'a>; 2],
    layers: &'a Layers<OUTPUTS>,
    transposed: Transposed,
}

/// A field, and the instruction set to run on.
#[derive(Debug)]
pub(super) struct Prepared<'a> {
    pub(super) level: Level,
    pub(super) field: &'a TriplaneField,
    pub(super) origin: Vector3<f64>,
    pub(super) geometry: Head<'a, 1>,
    pub(super) colour: Head<'a, 3>,
    pub(super) sharpness: f32,
}

/// Samples along rays with what the field has there.
#[derive(Clone, Debug, Default)]
pub(super) struct FieldSamples<const OUTPUTS: usize> {
    /// x, y and z relative to the origin of the field, metres.
    pub(super) points: [Vec<f32>; 3],
    pub(super) activations: Activations<OUTPUTS>,
    /// Outputs after their activation, padded.
    pub(super) values: Vec<[f32; OUTPUTS]>,
    /// Gradient of the loss by the outputs, padded: by the values first, then before their activation.
    pub(super) grad_outputs: Vec<[f32; OUTPUTS]>,
    pub(super) grad_features: Vec<[f32; FEATURES]>,
    pub(super) grad_points: Vec<[f32; 3]>,
}

impl<const OUTPUTS: usize> FieldSamples<OUTPUTS> {
    pub(super) fn clear(&mut self) {
        self.points.iter_mut().for_each(Vec::clear);
    }

    pub(super) fn push(&mut self, point: [f32; 3]) {
        self.points.iter_mut().zip(point).for_each(|(axis, x)| axis.push(x));
    }

    pub(super) fn extend(&mut self, points: impl Iterator<Item = [f32; 3]> + Clone) {
        for (axis, coordinates) in self.points.iter_mut().enumerate() {
            coordinates.extend(points.clone().map(|point| point[axis]));
        }
    }

    pub(super) fn len(&self) -> usize {
        self.points[0].len()
    }

    pub(super) fn points(&self) -> Points<'_> {
        self.points.each_ref().map(Vec::as_slice)
    }

    /// Gradients by the features, one per sample.
    pub(super) fn grad_features(&self) -> &[[f32; FEATURES]] {
        self.grad_features.get(..self.len()).unwrap_or_default()
    }

    /// Makes room for gradients, by the values all zero.
    pub(super) fn start_backward(&mut self) {
        let padded = self.activations.features.len();
        self.grad_outputs.clear();
        self.grad_outputs.resize(padded, [0.0; OUTPUTS]);
        self.grad_features.resize(padded, [0.0; FEATURES]);
    }
}

impl<'a, const OUTPUTS: usize> Head<'a, OUTPUTS> {
    fn new(planes: &'a [super::planes::FeaturePlanes; 2], layers: &'a Layers<OUTPUTS>) -> Self {
        let transposed = Transposed::new(layers);
        Self { planes: planes.each_ref().map(PlanesView::new), layers, transposed }
    }

    #[inline(always)]
    fn forward<S: Simd>(&self, simd: S, samples: &mut FieldSamples<OUTPUTS>) {
        let points = samples.points.each_ref().map(Vec::as_slice);
        samples.activations.resize(points[0].len());
        encode(simd, &self.planes, points, &mut samples.activations.features);
        decode(simd, self.layers, &mut samples.activations);
    }

    /// Gradients by features and weights from those by the outputs before their activation; by the points too if asked
    /// for.
    #[inline(always)]
    fn backward<S: Simd>(
        &self,
        simd: S,
        samples: &mut FieldSamples<OUTPUTS>,
        with_points: bool,
        grad_layers: &mut Layers<OUTPUTS>,
    ) {
        let FieldSamples { activations, grad_outputs, grad_features, .. } = samples;
        decode_backward(
            simd,
            self.layers,
            &self.transposed,
            activations,
            grad_outputs,
            grad_features,
            grad_layers,
        );
        let count = samples.len();
        samples.grad_points.resize(if with_points { count } else { 0 }, [0.0; 3]);
        if with_points {
            let points = samples.points.each_ref().map(Vec::as_slice);
            grad_points(simd, &self.planes, points, &samples.grad_features, &mut samples.grad_points);
        }
    }
}

impl<'a> Prepared<'a> {
    pub(super) fn new(level: Level, field: &'a TriplaneField) -> Self {
        Self {
            level,
            field,
            origin: field.region.origin(),
            geometry: Head::new(&field.geometry, &field.distance_decoder),
            colour: Head::new(&field.colour, &field.colour_decoder),
            sharpness: field.sharpness(),
        }
    }

    /// Signed distances of all samples, in truncations.
    pub(super) fn distances(&self, samples: &mut FieldSamples<1>) {
        dispatch!(self.level, simd => {
            self.geometry.forward(simd, samples);
            activate(simd, &samples.activations.outputs, &mut samples.values, tanh);
        });
    }

    /// Opacities of samples with those distances.
    pub(super) fn opacities(&self, samples: &FieldSamples<1>, out: &mut Vec<Opacity>) {
        dispatch!(self.level, simd => opacity(simd, samples.values.as_flattened(), self.sharpness, out));
    }

    /// Colours of all samples, linear light.
    pub(super) fn colours(&self, samples: &mut FieldSamples<3>) {
        dispatch!(self.level, simd => {
            self.colour.forward(simd, samples);
            activate(simd, &samples.activations.outputs, &mut samples.values, sigmoid);
        });
    }

    /// Takes the gradient by signed distances, in `grad_outputs`, to weights, features and perhaps points.
    pub(super) fn distances_backward(
        &self,
        samples: &mut FieldSamples<1>,
        with_points: bool,
        grad_layers: &mut Layers<1>,
    ) {
        let outputs = samples.grad_outputs.as_flattened_mut().iter_mut();
        outputs.zip(samples.values.as_flattened()).for_each(|(by, value)| *by *= 1.0 - value * value);
        dispatch!(self.level, simd => self.geometry.backward(simd, samples, with_points, grad_layers));
    }

    /// As [`Self::distances_backward`] for colours.
    pub(super) fn colours_backward(
        &self,
        samples: &mut FieldSamples<3>,
        with_points: bool,
        grad_layers: &mut Layers<3>,
    ) {
        let outputs = samples.grad_outputs.as_flattened_mut().iter_mut();
        outputs.zip(samples.values.as_flattened()).for_each(|(by, value)| *by *= value * (1.0 - value));
        dispatch!(self.level, simd => self.colour.backward(simd, samples, with_points, grad_layers));
    }
}

/// Stores `function` of all outputs.
#[inline(always)]
fn activate<S: Simd, const OUTPUTS: usize>(
    simd: S,
    outputs: &[[f32; OUTPUTS]],
    values: &mut Vec<[f32; OUTPUTS]>,
    function: impl Fn(f32x8<S>) -> f32x8<S>,
) {
    values.resize(outputs.len(), [0.0; OUTPUTS]);
    let outputs = outputs.as_flattened().chunks(LANES);
    for (out, outputs) in values.as_flattened_mut().chunks_mut(LANES).zip(outputs) {
        let mut lanes = [0.0; LANES];
        lanes[..outputs.len()].copy_from_slice(outputs);
        function(f32x8::load_array(simd, lanes)).store_array(&mut lanes);
        out.copy_from_slice(&lanes[..out.len()]);
    }
}

#[inline(always)]
fn tanh<S: Simd>(x: f32x8<S>) -> f32x8<S> {
    let one = f32x8::splat(x.token(), 1.0);
    one - f32x8::splat(x.token(), 2.0) / (exp(x + x) + 1.0)
}

#[inline(always)]
fn sigmoid<S: Simd>(x: f32x8<S>) -> f32x8<S> {
    f32x8::splat(x.token(), 1.0) / (exp(-x) + 1.0)
}
