//! Adam (Kingma and Ba 2015) over a field: all of the decoders, and those nodes of the planes that were seen.

use fearless_simd::{Level, dispatch, f32x8, prelude::*};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::field::TriplaneField;
use super::gradients::{FieldGradients, PlaneGradient, for_each_touched, plane_values_mut};
use super::layers::Layers;
use super::planes::FeaturePlanes;
use super::region::Region;
use super::settings::CHANNELS;

/// Decay of the mean of the gradient.
const BETA_1: f32 = 0.9;
/// Decay of the mean of its square.
const BETA_2: f32 = 0.99;
/// Keeps a step finite where there never was a gradient.
const EPSILON: f32 = 1e-15;

/// Lengths of steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldStep {
    /// Of features on the planes.
    pub planes: f32,
    /// Of the weights of the decoders.
    pub decoders: f32,
    /// Of the logarithm of the sharpness.
    pub log_sharpness: f32,
}

impl Default for FieldStep {
    /// Two to three times those of ESLAM, for a schedule that ends with much shorter ones.
    fn default() -> Self {
        Self { planes: 0.01, decoders: 3e-3, log_sharpness: 1e-3 }
    }
}

impl FieldStep {
    /// All lengths times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        Self {
            planes: self.planes * factor,
            decoders: self.decoders * factor,
            log_sharpness: self.log_sharpness * factor,
        }
    }
}

/// A number for everything that a field has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Moments {
    region: Region,
    /// Geometry coarse and fine, colour coarse and fine.
    planes: [FeaturePlanes; 4],
    distance_decoder: Layers<1>,
    colour_decoder: Layers<3>,
    log_sharpness: f32,
}

impl Moments {
    fn zeros(region: Region, field: &TriplaneField) -> Self {
        let [a, b] = field.geometry.each_ref();
        let [c, d] = field.colour.each_ref();
        Self {
            region,
            planes: [a, b, c, d].map(|planes| FeaturePlanes::zeros(&region, planes.refinement)),
            distance_decoder: Layers::default(),
            colour_decoder: Layers::default(),
            log_sharpness: 0.0,
        }
    }

    /// Makes room for a field that has grown.
    fn fit(&mut self, field: &TriplaneField) {
        if self.region != field.region {
            let mut larger = Self::zeros(field.region, field).planes;
            let pairs = larger.iter_mut().zip(&self.planes);
            pairs.for_each(|(larger, planes)| larger.copy_from(&field.region, planes, &self.region));
            (self.planes, self.region) = (larger, field.region);
        }
    }

    fn planes_mut(&mut self) -> impl Iterator<Item = &mut [f32]> {
        let sets = self.planes.iter_mut();
        sets.flat_map(|set| set.values.each_mut()).map(|plane| plane.0.as_mut_slice())
    }

    /// Decoders and sharpness.
    fn dense_mut(&mut self) -> Vec<&mut [f32]> {
        dense(&mut self.distance_decoder, &mut self.colour_decoder, &mut self.log_sharpness)
    }
}

/// All that every step moves, in a fixed order.
fn dense<'a>(
    distance_decoder: &'a mut Layers<1>,
    colour_decoder: &'a mut Layers<3>,
    log_sharpness: &'a mut f32,
) -> Vec<&'a mut [f32]> {
    let decoders = distance_decoder.parts_mut().into_iter().chain(colour_decoder.parts_mut());
    decoders.chain([core::slice::from_mut(log_sharpness)]).collect()
}

/// Moments of the gradients by a field.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriplaneAdam {
    /// Means of gradients and of squared gradients.
    moments: Option<Box<[Moments; 2]>>,
}

impl TriplaneAdam {
    /// Moves `field` one step against `gradients`, and leaves the gradients by its planes zero. Features that were not
    /// seen rest, and so do their moments. There is no correction for young moments: with these decays the first steps
    /// of a feature have once to twice their length, which is welcome.
    ///
    /// # Panics
    /// If the gradients are those of a field of another size.
    pub fn step(
        &mut self,
        level: Level,
        field: &mut TriplaneField,
        gradients: &mut FieldGradients,
        step: FieldStep,
    ) {
        let region = field.region;
        let moments = self
            .moments
            .get_or_insert_with(|| Box::new([Moments::zeros(region, field), Moments::zeros(region, field)]));
        moments.iter_mut().for_each(|moments| moments.fit(field));
        let [first, second] = &mut **moments;
        step_dense(field, gradients, [first, second], step);
        let moments = first.planes_mut().zip(second.planes_mut());
        let planes: Vec<_> =
            plane_values_mut(field).into_iter().zip(moments).zip(&mut gradients.planes).collect();
        planes.into_par_iter().for_each(|((values, (first, second)), gradient)| {
            assert!(
                [gradient.sums.len(), first.len(), second.len()] == [values.len(); 3],
                "the gradients of a plane of {} values cannot move one of {}",
                gradient.sums.len(),
                values.len()
            );
            dispatch!(level, simd => step_plane(simd, values, [first, second], gradient, step.planes));
            gradient.clear();
        });
    }
}

/// One step of decoders and sharpness.
fn step_dense(
    field: &mut TriplaneField,
    gradients: &mut FieldGradients,
    [first, second]: [&mut Moments; 2],
    step: FieldStep,
) {
    let values = dense(&mut field.distance_decoder, &mut field.colour_decoder, &mut field.log_sharpness);
    let gradients =
        dense(&mut gradients.distance_decoder, &mut gradients.colour_decoder, &mut gradients.log_sharpness);
    let last = values.len() - 1;
    let moments = first.dense_mut().into_iter().zip(second.dense_mut());
    for (part, ((values, gradients), (first, second))) in
        values.into_iter().zip(gradients).zip(moments).enumerate()
    {
        let length = if part == last { step.log_sharpness } else { step.decoders };
        for (k, value) in values.iter_mut().enumerate() {
            first[k] = BETA_1 * first[k] + (1.0 - BETA_1) * gradients[k];
            second[k] = BETA_2 * second[k] + (1.0 - BETA_2) * gradients[k] * gradients[k];
            *value -= length * first[k] / (second[k].sqrt() + EPSILON);
        }
    }
}

/// One step of the touched nodes of a plane.
#[inline(always)]
fn step_plane<S: Simd>(
    simd: S,
    values: &mut [f32],
    [first, second]: [&mut [f32]; 2],
    gradient: &PlaneGradient,
    length: f32,
) {
    for_each_touched(
        &gradient.touched,
        #[inline(always)]
        |node| {
            let range = node * CHANNELS..(node + 1) * CHANNELS;
            let parts = [&mut values[range.clone()], &mut first[range.clone()], &mut second[range.clone()]];
            let [values, first, second] = parts.map(|part| part.as_chunks_mut::<8>().0);
            let gradients = gradient.sums[range].as_chunks::<8>().0;
            for k in 0..gradients.len() {
                let gradient = f32x8::load_array_ref(simd, &gradients[k]);
                let mean = f32x8::load_array_ref(simd, &first[k]) * BETA_1 + gradient * (1.0 - BETA_1);
                let square = gradient * gradient;
                let square = f32x8::load_array_ref(simd, &second[k]) * BETA_2 + square * (1.0 - BETA_2);
                mean.store_array(&mut first[k]);
                square.store_array(&mut second[k]);
                let moved = mean * length / (square.sqrt() + EPSILON);
                (f32x8::load_array_ref(simd, &values[k]) - moved).store_array(&mut values[k]);
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triplane::FieldSettings;

    #[test]
    #[should_panic(expected = "cannot move one of")]
    fn gradients_of_a_smaller_field_are_refused() {
        let small = Region::around([0.0; 3], [0.1; 3]);
        let mut field = TriplaneField::new(small, FieldSettings::default(), 1);
        let mut gradients = FieldGradients::default();
        gradients.reset(&field);
        field.grow(&Region::around([0.0; 3], [2.0; 3]));
        TriplaneAdam::default().step(Level::new(), &mut field, &mut gradients, FieldStep::default());
    }
}
