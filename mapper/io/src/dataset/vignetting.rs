//! Fall-off of light over the frames of a data set, which may be stored with distortion.

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::photometric::{Vignetting, radius_squared};
use nalgebra::{Matrix2, Vector2};

/// The share of light at each pixel of frames of `ideal`, of which `source` gives the place in the stored image of
/// size `stored`; nothing for frames that are as stored. A place outside that image counts as the nearest inside.
pub(super) fn falloff_of_pixels(
    vignetting: &Vignetting,
    ideal: &PinholeCamera,
    stored: (usize, usize),
    source: Option<&[[f32; 2]]>,
) -> Vec<f32> {
    // Maximum and minimum, unlike a clamp, also bring NaN into the image.
    let inside = |x: f64, side: usize| x.max(0.0).min(side as f64 - 1.0);
    let at = |pixel: usize| {
        let place = [(pixel % ideal.width) as f64, (pixel / ideal.width) as f64];
        let [u, v] = source.map_or(place, |map| map[pixel].map(f64::from));
        vignetting.falloff_at(stored.0, stored.1, inside(u, stored.0), inside(v, stored.1)) as f32
    };
    (0..ideal.width * ideal.height).map(at).collect()
}

/// Pixels from one sample of [`falloff_of_frames`] to the next, along rows and columns.
const SAMPLE_STEP: usize = 16;

/// The fall-off over frames of `ideal`, of which `source` gives the place in the stored image of size `stored`, as a
/// polynomial of the distance in the frames: that of the stored image where they are as stored, else the nearest one.
pub(super) fn falloff_of_frames(
    vignetting: &Vignetting,
    ideal: &PinholeCamera,
    stored: (usize, usize),
    source: Option<&[[f32; 2]]>,
) -> Vignetting {
    let Some(map) = source.filter(|_| !vignetting.is_none()) else { return *vignetting };
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for v in (0..ideal.height).step_by(SAMPLE_STEP) {
        for u in (0..ideal.width).step_by(SAMPLE_STEP) {
            let [from_u, from_v] = map[v * ideal.width + u].map(f64::from);
            let is_inside =
                (0.0..stored.0 as f64).contains(&from_u) && (0.0..stored.1 as f64).contains(&from_v);
            if is_inside {
                let squared = radius_squared(ideal.width, ideal.height, u as f64, v as f64);
                let powers = Vector2::new(squared, squared * squared);
                normal += powers * powers.transpose();
                right += powers * (vignetting.falloff_at(stored.0, stored.1, from_u, from_v) - 1.0);
            }
        }
    }
    let fitted = normal.try_inverse().map(|inverse| inverse * right);
    let fitted = fitted.map_or(*vignetting, |a| Vignetting { a2: a.x, a4: a.y });
    // Beyond the samples the polynomial may do as it likes; light that falls to nothing cannot be given back.
    if fitted.least() > 0.0 { fitted } else { *vignetting }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_without_the_border_of_the_stored_image_see_less_of_the_fall_off() {
        let ideal = PinholeCamera { width: 320, height: 240, fx: 300.0, fy: 300.0, cx: 159.5, cy: 119.5 };
        let lens = Vignetting { a2: -0.35, a4: 0.05 };
        assert_eq!(falloff_of_frames(&lens, &ideal, (320, 240), None), lens);
        // Frames that show the middle of the stored image, twice as large.
        let place = |pixel: usize| {
            let (u, v) = ((pixel % 320) as f32, (pixel / 320) as f32);
            [159.5 + 0.5 * (u - 159.5), 119.5 + 0.5 * (v - 119.5)]
        };
        let map: Vec<[f32; 2]> = (0..320 * 240).map(place).collect();
        let seen = falloff_of_frames(&lens, &ideal, (320, 240), Some(&map));
        assert!((seen.a2 + 0.35 / 4.0).abs() < 1e-6 && (seen.a4 - 0.05 / 16.0).abs() < 1e-6, "{seen:?}");
    }
}
