//! Depth without the sensor's noise, to seed Gaussians from.
//!
//! Gaussians on noisy depths hide each other: what is seen is the front of the noise, nearer than the surface, and a
//! map that is too near makes the whole trajectory too short.

use rayon::prelude::*;

use mba_raster::sensor::Observation;

/// Pixels on each side that take part.
const RADIUS: usize = 4;

/// Inverse depths further from that of the middle than this count as another surface, as a fraction of it.
const SAME_SURFACE: f32 = 0.03;

/// Depth in metres of every pixel that has one, 0 elsewhere: where `is_wanted`, the mean of inverse depth over pairs of
/// pixels on opposite sides, else as it was measured. Inverse depth is linear in pixels on a plane, so a plane of any
/// slant comes back as it is.
pub(super) fn smooth_depth(seen: &Observation, is_wanted: impl Fn(usize) -> bool + Sync) -> Vec<f32> {
    let (width, height) = (seen.camera.width, seen.camera.height);
    let at = |pixel: usize| {
        if is_wanted(pixel) { smoothed(&seen.depth, width, height, pixel) } else { seen.depth[pixel] }
    };
    (0..width * height).into_par_iter().map(at).collect()
}

fn smoothed(depth: &[f32], width: usize, height: usize, pixel: usize) -> f32 {
    let (x, y) = (pixel % width, pixel / width);
    let middle = depth[pixel];
    if middle <= 0.0 {
        return 0.0;
    }
    let middle = 1.0 / middle;
    let (mut sum, mut count) = (middle, 1.0);
    // The upper half of the window and the left half of the row; their opposites are the rest.
    for dy in 0..=RADIUS.min(y).min(height - 1 - y) {
        let reach = RADIUS.min(x).min(width - 1 - x);
        for dx in 0..=2 * reach {
            if dy == 0 && dx >= reach {
                break;
            }
            let one = pixel - dy * width + dx - reach;
            let other = 2 * pixel - one;
            let pair = [depth[one], depth[other]];
            if pair.iter().all(|z| *z > 0.0 && (1.0 / z - middle).abs() < SAME_SURFACE * middle) {
                sum += 1.0 / pair[0] + 1.0 / pair[1];
                count += 2.0;
            }
        }
    }
    count / sum
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::PinholeCamera;
    use mba_tracker::image::PixelRectangle;

    use super::*;
    use mba_raster::exposure::RowTimes;

    const SIZE: [usize; 2] = [32, 24];

    fn observation(depth: impl Fn(usize, usize) -> f32) -> Observation {
        let [width, height] = SIZE;
        Observation {
            camera: PinholeCamera { width, height, fx: 30.0, fy: 30.0, cx: 15.5, cy: 11.5 },
            colour: [const { Vec::new() }; 3],
            depth: (0..width * height).map(|pixel| depth(pixel % width, pixel / width)).collect(),
            region: PixelRectangle { left: 0, top: 0, right: width, bottom: height },
            times: RowTimes::GLOBAL,
            falloff: None,
        }
    }

    #[test]
    fn planes_and_steps_stay_and_holes_stay_holes() {
        let plane = |x: usize, y: usize| 1.0 / (0.25 + 0.002 * x as f32 - 0.001 * y as f32);
        let seen = observation(|x, y| match x {
            5 => 0.0,
            ..16 => plane(x, y),
            _ => 2.0,
        });
        for (smooth, given) in smooth_depth(&seen, |_| true).iter().zip(&seen.depth) {
            assert!((smooth - given).abs() < 1e-5 * given.max(1.0), "{smooth} instead of {given}");
        }
    }

    #[test]
    fn noise_shrinks() {
        let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + x * y * 31) % 1000) as f32 / 1000.0 - 0.5;
        let seen = observation(|x, y| 1.0 / (0.25 + 0.006 * noise(x, y)));
        let deviation = |depth: &[f32]| {
            let squares = depth.iter().map(|z| (1.0 / z - 0.25).powi(2)).sum::<f32>();
            (squares / depth.len() as f32).sqrt()
        };
        assert!(deviation(&smooth_depth(&seen, |_| true)) < 0.3 * deviation(&seen.depth));
        assert_eq!(smooth_depth(&seen, |_| false), seen.depth);
    }
}
