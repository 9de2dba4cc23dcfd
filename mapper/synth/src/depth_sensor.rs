//! Depth as it is stored: exact, or as a structured-light camera measures it.

use rayon::prelude::*;

use super::DepthSensor;
use super::random::{Purpose, RowRandom};
use super::render::DepthSample;

/// Stored units per metre.
pub(super) const UNITS_PER_METRE: f32 = 5000.0;

/// Standard deviation of the measured inverse depth, 1/m: that of depth is this times depth squared, metres
/// (the quadratic coefficient that Nguyen, Izadi and Lovell 2012 measured for the Kinect).
pub(super) const INVERSE_DEPTH_SIGMA: f32 = 0.0019;

/// Pixels over which the error is correlated: the matching window of the sensor.
const CORRELATION: usize = 5;

/// Nearest and furthest depth that is measured, metres.
const RANGE: std::ops::RangeInclusive<f32> = 0.4..=8.0;

/// Below this cosine of the angle of incidence the pattern is not recognised.
const GRAZING: f32 = 0.15;

/// Bend of the inverse depth between neighbours, 1/m, that marks an edge. Planes have none.
const EDGE: f32 = 0.004;

impl DepthSensor {
    /// Stored depth of the image with rows of `width` samples; 0 is missing.
    pub(super) fn measure(self, samples: &[DepthSample], width: usize, seed: u64, frame: usize) -> Vec<u16> {
        let mut stored = vec![0; samples.len()];
        stored.par_chunks_mut(width).enumerate().for_each(|(row, stored)| match self {
            Self::Exact => {
                let samples = &samples[row * width..];
                stored.iter_mut().zip(samples).for_each(|(stored, sample)| *stored = units(sample.depth));
            }
            Self::StructuredLight => {
                let error = smooth_error(seed, frame, row, width);
                for (column, (stored, error)) in stored.iter_mut().zip(error).enumerate() {
                    *stored = measured(samples, width, row, column, error);
                }
            }
        });
        stored
    }
}

/// Depth in stored units, or missing if it does not fit.
fn units(depth: f32) -> u16 {
    let units = (depth * UNITS_PER_METRE).round();
    if units <= f32::from(u16::MAX) { units as u16 } else { 0 }
}

fn measured(samples: &[DepthSample], width: usize, row: usize, column: usize, error: f32) -> u16 {
    let DepthSample { depth, incidence } = samples[row * width + column];
    let seen = RANGE.contains(&depth) && incidence >= GRAZING && !at_edge(samples, width, row, column);
    let inverse = 1.0 / depth + INVERSE_DEPTH_SIGMA * error;
    if !seen || inverse <= 0.0 {
        return 0;
    }
    units((1000.0 / inverse).round() / 1000.0)
}

/// Whether the surface breaks off next to the pixel.
fn at_edge(samples: &[DepthSample], width: usize, row: usize, column: usize) -> bool {
    let height = samples.len() / width;
    let inverse = |row: usize, column: usize| 1.0 / samples[row * width + column].depth;
    let bend = |a: f32, b: f32, c: f32| (a - 2.0 * b + c).abs() > EDGE;
    let here = inverse(row, column);
    let across =
        column > 0 && column + 1 < width && bend(inverse(row, column - 1), here, inverse(row, column + 1));
    let down = row > 0 && row + 1 < height && bend(inverse(row - 1, column), here, inverse(row + 1, column));
    across || down
}

/// Standard normal errors along a row, correlated over [`CORRELATION`] pixels in both directions: normal numbers
/// on a lattice, blended between its points and scaled back to unit variance.
fn smooth_error(seed: u64, frame: usize, row: usize, width: usize) -> Vec<f32> {
    let lattice_row = row / CORRELATION;
    let down = weights(row % CORRELATION);
    let upper = lattice_numbers(seed, frame, lattice_row, width);
    let lower = lattice_numbers(seed, frame, lattice_row + 1, width);
    let blended = |column: usize| {
        let (left, across) = (column / CORRELATION, weights(column % CORRELATION));
        let mix = |numbers: &[f32]| numbers[left] * across[0] + numbers[left + 1] * across[1];
        mix(&upper) * down[0] + mix(&lower) * down[1]
    };
    (0..width).map(blended).collect()
}

/// Weights of two lattice points between which a pixel lies; their squares sum to 1.
fn weights(step: usize) -> [f32; 2] {
    let x = (step as f32 + 0.5) / CORRELATION as f32;
    let scale = 1.0 / (x * x + (1.0 - x) * (1.0 - x)).sqrt();
    [(1.0 - x) * scale, x * scale]
}

fn lattice_numbers(seed: u64, frame: usize, lattice_row: usize, width: usize) -> Vec<f32> {
    let mut random = RowRandom::new(seed, Purpose::Depth, frame, lattice_row);
    (0..width / CORRELATION + 2).map(|_| random.normal_pair()[0]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane tilted about the vertical, `depth` in the middle.
    fn plane(depth: f32, width: usize, height: usize) -> Vec<DepthSample> {
        let slope = |column: usize| 1.0 / depth + 1e-4 * (column as f32 - 0.5 * width as f32);
        let sample = |index: usize| DepthSample { depth: 1.0 / slope(index % width), incidence: 0.9 };
        (0..width * height).map(sample).collect()
    }

    #[test]
    fn error_grows_with_depth_squared_and_is_correlated() {
        const WIDTH: usize = 320;
        for depth in [2.0_f32, 5.0] {
            let truth = plane(depth, WIDTH, 240);
            let stored = DepthSensor::StructuredLight.measure(&truth, WIDTH, 3, 0);
            let error = |index: usize| {
                let z = f64::from(truth[index].depth);
                (f64::from(stored[index]) / 5000.0 - z) / (0.0019 * z * z)
            };
            let mean_of = |product: &dyn Fn(usize) -> f64| {
                let inner = (0..240 * WIDTH).filter(|index| index % WIDTH < WIDTH - 12);
                let (sum, count) =
                    inner.fold((0.0, 0.0), |(sum, count), index| (sum + product(index), count + 1.0));
                sum / count
            };
            // 240 x 308 pixels hold about 3000 independent errors: 2.6 % standard error of the variance.
            let variance = mean_of(&|index| error(index).powi(2));
            assert!((variance - 1.0).abs() < 0.12, "variance {variance} at {depth} m");
            assert!(mean_of(&|index| error(index) * error(index + 1)) > 0.75);
            assert!(mean_of(&|index| error(index) * error(index + 12)).abs() < 0.12);
            assert!(
                stored.iter().all(|stored| *stored > 0 && stored % 5 == 0),
                "whole millimetres, no holes"
            );
        }
    }

    #[test]
    fn holes_are_at_edges_grazing_angles_and_out_of_range() {
        const WIDTH: usize = 20;
        let mut samples = plane(3.0, WIDTH, 4);
        for row in 0..4 {
            samples[row * WIDTH..row * WIDTH + 5].fill(DepthSample { depth: 2.0, incidence: 1.0 });
            samples[row * WIDTH + 12].incidence = 0.1;
            samples[row * WIDTH + 16..(row + 1) * WIDTH].fill(DepthSample { depth: 8.5, incidence: 1.0 });
        }
        let stored = DepthSensor::StructuredLight.measure(&samples, WIDTH, 3, 0);
        let missing: Vec<usize> = (0..WIDTH).filter(|column| stored[WIDTH + column] == 0).collect();
        assert_eq!(missing, [4, 5, 12, 15, 16, 17, 18, 19]);
        let exact = DepthSensor::Exact.measure(&samples, WIDTH, 3, 0);
        assert_eq!((exact[0], exact[19]), (10_000, 42_500));
        assert_eq!(units(13.2), 0, "beyond 16 bits");
    }
}
