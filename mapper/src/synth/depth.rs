//! Depth images: exact, or as a structured-light sensor sees them.

use rayon::prelude::*;

use super::noise::{Purpose, normal, stream, uniform};
use super::render::SurfaceSample;

/// Raw units per metre in depth images.
pub(super) const DEPTH_SCALE: f32 = 5000.0;

/// Standard deviation of the structured-light sensor's depth at 1 m, metres; it grows with the square of depth
/// because the error is one of disparity.
pub(super) const SIGMA_AT_ONE_METRE: f32 = 0.0019;

/// Farthest depth of the structured-light sensor, metres.
const RANGE: f32 = 8.0;

/// Smallest cosine between surface normal and viewing direction that gives a depth.
const GRAZING: f32 = 0.17;

/// Slope, depth per sideways distance, that counts as a depth edge: 86 degrees.
const EDGE: f32 = 15.0;

/// Share of valid pixels that are missing without a reason.
const LOSS: f64 = 0.002;

/// Exact depth in raw units; 0 where nothing is met or the depth exceeds 16 bits (13.1 m).
pub(super) fn exact(surface: &[SurfaceSample]) -> Vec<u16> {
    surface.iter().map(|sample| raw(sample.z)).collect()
}

fn raw(z: f32) -> u16 {
    let units = (z * DEPTH_SCALE + 0.5).floor();
    if units >= 1.0 && units <= f32::from(u16::MAX) { units as u16 } else { 0 }
}

/// Depth as a structured-light sensor measures it, in raw units; 0 = missing.
///
/// `focal` is the focal length in pixels; it tells a steep surface from a depth edge.
pub(super) fn structured_light(
    surface: &[SurfaceSample],
    width: usize,
    focal: f32,
    seed: u64,
    frame: usize,
) -> Vec<u16> {
    let height = surface.len() / width;
    let noise = correlated_noise(width, height, seed, frame);
    let mut image = vec![0; surface.len()];
    image.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let mut random = stream(seed, Purpose::DepthLoss, frame, y);
        for (x, out) in row.iter_mut().enumerate() {
            let lost = uniform(&mut random) < LOSS;
            let sample = surface[y * width + x];
            let seen = sample.z <= RANGE
                && sample.facing >= GRAZING
                && !near_edge(surface, width, EDGE / focal, x, y);
            if seen && !lost {
                // An error of disparity d ~ 1/z: z is the reciprocal of a noisy reciprocal.
                let inverse = 1.0 / sample.z + SIGMA_AT_ONE_METRE * noise[y * width + x];
                let millimetres = (1000.0 / inverse + 0.5).floor();
                *out = raw(millimetres * 1e-3);
            }
        }
    });
    image
}

/// Whether the depth jumps within two pixels to the left or right or one above or below: the pattern is shadowed.
fn near_edge(surface: &[SurfaceSample], width: usize, edge: f32, x: usize, y: usize) -> bool {
    let z = surface[y * width + x].z;
    let height = surface.len() / width;
    let columns = x.saturating_sub(2)..(x + 3).min(width);
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    let jumps = |other: f32, steps: usize| (other - z).abs() > edge * z * steps as f32;
    columns.into_iter().any(|i| i != x && jumps(surface[y * width + i].z, i.abs_diff(x)))
        || rows.into_iter().any(|j| j != y && jumps(surface[j * width + x].z, 1))
}

/// Correlation window of the matching: the sensor compares patches, so neighbours share their error.
const WINDOW: usize = 5;

/// Noise of mean 0 and variance 1, smoothed by a square window: correlated over about [`WINDOW`] pixels.
fn correlated_noise(width: usize, height: usize, seed: u64, frame: usize) -> Vec<f32> {
    let (wide, high) = (width + WINDOW - 1, height + WINDOW - 1);
    let mut white = vec![0.0_f32; wide * high];
    white.par_chunks_mut(wide).enumerate().for_each(|(y, row)| {
        let mut random = stream(seed, Purpose::Depth, frame, y);
        row.iter_mut().for_each(|value| *value = normal(&mut random) as f32);
    });
    let mut smooth = vec![0.0_f32; width * height];
    smooth.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let columns: Vec<f32> =
            (0..wide).map(|x| (0..WINDOW).map(|dy| white[(y + dy) * wide + x]).sum()).collect();
        for (value, window) in row.iter_mut().zip(columns.windows(WINDOW)) {
            *value = window.iter().sum::<f32>() / WINDOW as f32;
        }
    });
    smooth
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(z: f32, width: usize, height: usize) -> Vec<SurfaceSample> {
        vec![SurfaceSample { z, facing: 1.0 }; width * height]
    }

    #[test]
    fn noise_grows_with_the_square_of_depth_and_is_correlated() {
        let (width, height) = (200, 150);
        for z in [1.0_f32, 3.0] {
            let image = structured_light(&plane(z, width, height), width, 500.0, 5, 2);
            let error = |k: usize| f64::from(image[k]) / 5000.0 - f64::from(z);
            let valid: Vec<usize> = (0..image.len()).filter(|k| image[*k] > 0).collect();
            let missing = 1.0 - valid.len() as f64 / image.len() as f64;
            assert!((missing - 0.002).abs() < 0.001, "{missing}");
            let variance = valid.iter().map(|k| error(*k).powi(2)).sum::<f64>() / valid.len() as f64;
            // Millimetre steps add their twelfth; about 1200 independent patches leave 2 % of doubt.
            let expected = (0.0019 * f64::from(z * z)).powi(2) + 1e-6 / 12.0;
            assert!((variance / expected - 1.0).abs() < 0.1, "{z}: {variance} {expected}");
            let pairs = |step: usize| {
                let both = valid.iter().filter(|k| *k % width + step < width && image[*k + step] > 0);
                let products: Vec<f64> = both.map(|k| error(*k) * error(k + step)).collect();
                products.iter().sum::<f64>() / products.len() as f64 / variance
            };
            // The overlap of the windows: 4/5 one pixel apart (less the steps' share), none six apart.
            assert!((pairs(1) - 0.8 * (1.0 - 1e-6 / 12.0 / expected)).abs() < 0.05, "{}", pairs(1));
            assert!(pairs(6).abs() < 0.1, "{}", pairs(6));
        }
    }

    #[test]
    fn edges_grazing_and_far_surfaces_are_missing() {
        let (width, height) = (40, 20);
        let mut surface = plane(2.0, width, height);
        surface.iter_mut().enumerate().filter(|(k, _)| k % width >= 20).for_each(|(_, s)| s.z = 3.0);
        let image = structured_light(&surface, width, 500.0, 1, 0);
        let valid_in = |x: usize| (0..height).filter(|y| image[y * width + x] > 0).count();
        assert_eq!((18..22).map(valid_in).sum::<usize>(), 0);
        assert!(valid_in(17) >= height - 2 && valid_in(22) >= height - 2);
        let mut far = plane(8.1, width, height);
        far[0] = SurfaceSample { z: 2.0, facing: 0.1 };
        assert!(structured_light(&far, width, 500.0, 1, 0).iter().all(|raw| *raw == 0));
    }

    #[test]
    fn exact_depth_is_rounded_to_its_unit_and_zero_where_it_does_not_fit() {
        let of = |z| exact(&plane(z, 1, 1))[0];
        assert_eq!([of(1.00009), of(1.00011), of(13.2), of(f32::INFINITY)], [5000, 5001, 0, 0]);
    }
}
