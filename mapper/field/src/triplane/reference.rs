//! What the kernels compute, in plain double precision, and the kernels against it.

use mba_tracker::simd::{Level, levels_up_to};
use rand_pcg::Pcg32;

use super::field::TriplaneField;
use super::gradients::FieldGradients;
use super::layers::Layers;
use super::planes::{FeaturePlanes, PLANE_AXES, signed_unit, unit};
use super::prepared::{FieldSamples, Prepared};
use super::region::Region;
use super::settings::{CHANNELS, FieldSettings, HIDDEN};

/// A box of 5 x 4 x 3 coarse cells.
pub(super) fn region() -> Region {
    Region::around([-0.4, 0.1, 0.5], [0.6, 0.9, 1.1])
}

/// A field with values of some size everywhere.
pub(super) fn lively_field() -> TriplaneField {
    let settings = FieldSettings { geometry_cells: 2, colour_cells: 3, ..FieldSettings::default() };
    let mut field = TriplaneField::new(region(), settings, 11);
    for planes in field.geometry.iter_mut().chain(&mut field.colour) {
        let values = planes.values.iter_mut().flat_map(|plane| &mut plane.0);
        values.for_each(|value| *value *= 60.0);
    }
    field.distance_decoder.last_bias = [0.0];
    field
}

/// Features at a point in the coordinates of the field.
fn features(levels: &[FeaturePlanes; 2], point: [f64; 3]) -> Vec<f64> {
    let at_level = |planes: &FeaturePlanes| {
        let mut sums = vec![0.0; CHANNELS];
        for (plane, [u, v]) in PLANE_AXES.into_iter().enumerate() {
            let place = |axis: usize| {
                let last = (planes.nodes[axis] - 1) as f64;
                let x = (point[axis] / planes.cell()).clamp(0.0, last);
                let cell = x.min(last - 1.0).floor();
                (cell as usize, x - cell)
            };
            let ((i, x), (j, y)) = (place(u), place(v));
            for (di, dj, weight) in
                [(0, 0, (1.0 - x) * (1.0 - y)), (1, 0, x * (1.0 - y)), (0, 1, (1.0 - x) * y), (1, 1, x * y)]
            {
                let node = ((j + dj) * planes.nodes[u] + i + di) * CHANNELS;
                let values = &planes.values[plane].0[node..node + CHANNELS];
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * f64::from(*value));
            }
        }
        sums
    };
    levels.iter().flat_map(at_level).collect()
}

/// Outputs before their activation.
fn decode<const OUTPUTS: usize>(layers: &Layers<OUTPUTS>, features: &[f64]) -> [f64; OUTPUTS] {
    let hidden = |rows: &[[f32; HIDDEN]], bias: &[f32; HIDDEN], inputs: &[f64]| -> Vec<f64> {
        let unit = |k: usize| {
            let products = rows.iter().zip(inputs).map(|(row, input)| f64::from(row[k]) * input);
            (products.sum::<f64>() + f64::from(bias[k])).max(0.0)
        };
        (0..HIDDEN).map(unit).collect()
    };
    let first = hidden(&layers.first, &layers.first_bias, features);
    let second = hidden(&layers.second, &layers.second_bias, &first);
    core::array::from_fn(|k| {
        let products = layers.last[k].iter().zip(&second).map(|(weight, unit)| f64::from(*weight) * unit);
        products.sum::<f64>() + f64::from(layers.last_bias[k])
    })
}

fn distance(field: &TriplaneField, point: [f64; 3]) -> f64 {
    decode(&field.distance_decoder, &features(&field.geometry, point))[0].tanh()
}

fn colour(field: &TriplaneField, point: [f64; 3]) -> [f64; 3] {
    decode(&field.colour_decoder, &features(&field.colour, point)).map(|x| 1.0 / (1.0 + (-x).exp()))
}

/// Points all over the box and a little beyond.
fn points(count: usize) -> Vec<[f32; 3]> {
    let mut random = Pcg32::new(5, 5);
    (0..count).map(|_| [1.2, 0.96, 0.72].map(|side| side * (1.1 * unit(&mut random) - 0.05))).collect()
}

/// Weights of a made-up loss: the sum of products with the outputs.
fn weight(point: usize, output: usize) -> f32 {
    signed_unit(&mut Pcg32::new(point as u64, output as u64))
}

fn filled<const OUTPUTS: usize>(points: &[[f32; 3]]) -> FieldSamples<OUTPUTS> {
    let mut samples = FieldSamples::default();
    points.iter().for_each(|point| samples.push(*point));
    samples
}

/// The loss of the reference.
fn loss(field: &TriplaneField, points: &[[f64; 3]]) -> f64 {
    let of_point = |(k, point): (usize, &[f64; 3])| {
        let colours = colour(field, *point).into_iter().enumerate();
        let colours: f64 = colours.map(|(c, value)| value * f64::from(weight(k, c))).sum();
        colours + distance(field, *point) * f64::from(weight(k, 7))
    };
    points.iter().enumerate().map(of_point).sum()
}

/// Gradients of the loss by field and points from the kernels.
fn gradients(level: Level, field: &TriplaneField, points: &[[f32; 3]]) -> (FieldGradients, Vec<[f32; 3]>) {
    let prepared = Prepared::new(level, field);
    let (mut geometry, mut colours) = (filled::<1>(points), filled::<3>(points));
    prepared.distances(&mut geometry);
    prepared.colours(&mut colours);
    geometry.start_backward();
    colours.start_backward();
    for k in 0..points.len() {
        geometry.grad_outputs[k] = [weight(k, 7)];
        colours.grad_outputs[k] = core::array::from_fn(|c| weight(k, c));
    }
    let mut sums = FieldGradients::default();
    sums.reset(field);
    prepared.distances_backward(&mut geometry, true, &mut sums.distance_decoder);
    prepared.colours_backward(&mut colours, true, &mut sums.colour_decoder);
    let [of_geometry, of_colour] =
        [[(geometry.points(), geometry.grad_features())], [(colours.points(), colours.grad_features())]];
    sums.add_planes(&prepared, &of_geometry, &of_colour);
    let grad_points = geometry.grad_points.iter().zip(&colours.grad_points);
    (sums, grad_points.map(|(a, b)| [0, 1, 2].map(|axis| a[axis] + b[axis])).collect())
}

#[test]
fn values_are_those_of_the_reference_at_every_level() {
    let (field, points) = (lively_field(), points(101));
    for level in levels_up_to(Level::new()) {
        let prepared = Prepared::new(level, &field);
        let (mut geometry, mut colours) = (filled::<1>(&points), filled::<3>(&points));
        prepared.distances(&mut geometry);
        prepared.colours(&mut colours);
        let mut spread = [1.0_f32, -1.0];
        for (k, point) in points.iter().map(|point| point.map(f64::from)).enumerate() {
            let [found] = geometry.values[k];
            spread = [spread[0].min(found), spread[1].max(found)];
            let expected = distance(&field, point);
            assert!((f64::from(found) - expected).abs() < 1e-5, "{found} instead of {expected}");
            for (found, expected) in colours.values[k].iter().zip(colour(&field, point)) {
                assert!((f64::from(*found) - expected).abs() < 1e-5, "{found} instead of {expected}");
            }
        }
        assert!(spread[1] - spread[0] > 0.2, "distances that hardly differ would hide errors: {spread:?}");
    }
}

#[test]
fn gradients_are_those_of_finite_differences_at_every_level() {
    let (field, points) = (lively_field(), points(37));
    let exact: Vec<[f64; 3]> = points.iter().map(|point| point.map(f64::from)).collect();
    for level in levels_up_to(Level::new()) {
        let (mut sums, grad_points) = gradients(level, &field, &points);
        let check = |what: &str, analytic: f32, change: &dyn Fn(&mut TriplaneField, f32)| {
            let moved = |by: f32| {
                let mut moved = field.clone();
                change(&mut moved, by);
                loss(&moved, &exact)
            };
            let numeric = (moved(1e-4) - moved(-1e-4)) / 2e-4;
            let error = (numeric - f64::from(analytic)).abs();
            assert!(error < 3e-3 * (1.0 + numeric.abs()), "{what}: {analytic} instead of {numeric}");
        };
        for part in 0..6 {
            for k in [0, 5, 11] {
                let k = k % sums.distance_decoder.parts()[part].len();
                let by = sums.distance_decoder.parts()[part][k];
                check("distance", by, &|field, by| field.distance_decoder.parts_mut()[part][k] += by);
                let k = k % sums.colour_decoder.parts()[part].len();
                let by = sums.colour_decoder.parts()[part][k];
                check("colour", by, &|field, by| field.colour_decoder.parts_mut()[part][k] += by);
            }
        }
        for plane in 0..12 {
            let gradient = &mut sums.planes[plane];
            let count = gradient.sums.len();
            for k in (0..count).step_by(count / 7) {
                check("plane", gradient.sums[k], &|field, by| {
                    super::gradients::plane_values_mut(field)[plane][k] += by;
                });
            }
            gradient.clear();
            assert!(gradient.sums.iter().all(|sum| *sum == 0.0), "touched nodes are all there are");
        }
        for (k, by) in grad_points.iter().enumerate() {
            for axis in 0..3 {
                let moved = |by: f64| {
                    let mut moved = exact.clone();
                    moved[k][axis] += by;
                    loss(&field, &moved)
                };
                let numeric = (moved(1e-7) - moved(-1e-7)) / 2e-7;
                let error = (numeric - f64::from(by[axis])).abs();
                assert!(error < 1e-3 * (1.0 + numeric.abs()), "{k} {axis}: {by:?}, not {numeric}");
            }
        }
    }
}
