//! How much brighter one frame is than another: automatic exposure changes from frame to frame, and a map has one light.

use mba_io::statistics::quantile;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::photometric::InverseResponse;

use mba_raster::losses::CLIPPED;
use mba_raster::sensor::Observation;

/// Every so many columns and rows a point is compared.
const STRIDE: usize = 5;

/// Fewest points that a ratio follows from.
const FEWEST_POINTS: usize = 100;

/// Stored values below this are mostly noise.
const DARK: u8 = 20;

/// Depths that differ by more than this ratio are those of different surfaces.
const SAME_SURFACE: f64 = 0.05;

/// Logarithms of ratios of brightness up to this are left to the adjustment.
pub const NOTICEABLE: f64 = 0.04;

/// A frame at a pose, `world_from_camera` at mid exposure.
#[derive(Clone, Copy)]
pub struct Placed<'a> {
    /// What was captured.
    pub seen: &'a Observation,
    /// The pose at mid exposure.
    pub world_from_camera: RigidTransform,
}

/// Logarithm of the median ratio of the light of `other` to that of `one` at the surfaces that both show; `None` if they
/// share too few. Blur and rows cost exactness at edges only, which a median does not mind.
pub fn log_brightness(response: &InverseResponse, one: Placed<'_>, other: Placed<'_>) -> Option<f64> {
    let camera = &one.seen.camera;
    let other_from_one = other.world_from_camera.inverse().compose(&one.world_from_camera);
    let mut ratios = Vec::new();
    for v in (0..camera.height).step_by(STRIDE) {
        for u in (0..camera.width).step_by(STRIDE) {
            // The surface point of a pixel of one picture, and where the other one sees it.
            let depth = f64::from(one.seen.depth[v * camera.width + u]);
            let point = other_from_one.transform_point(&(camera.ray(u as f64, v as f64) * depth));
            let Some(pixel) = pixel_of(other.seen, &point).filter(|_| depth > 0.0) else { continue };
            let measured = f64::from(other.seen.depth[pixel]);
            // Something else is in front of it, or it has moved.
            if (measured - point.z).abs() > SAME_SURFACE * point.z {
                continue;
            }
            let lights =
                [light(response, one.seen, v * camera.width + u), light(response, other.seen, pixel)];
            if let [Some(one), Some(other)] = lights {
                ratios.push((other / one).ln());
            }
        }
    }
    (ratios.len() >= FEWEST_POINTS).then(|| quantile(&ratios, 0.5)).flatten()
}

/// The pixel at which a point in the camera's frame is seen.
fn pixel_of(seen: &Observation, point: &nalgebra::Vector3<f64>) -> Option<usize> {
    let camera = &seen.camera;
    let pixel = camera.project(point);
    let (u, v) = (pixel.x.round(), pixel.y.round());
    let inside = point.z > 0.0 && u >= 0.0 && v >= 0.0 && u < camera.width as f64 && v < camera.height as f64;
    inside.then(|| v as usize * camera.width + u as usize)
}

/// Light of all colours together before the lens; none where the sensor was blind to it.
fn light(response: &InverseResponse, seen: &Observation, pixel: usize) -> Option<f64> {
    let bytes = seen.colour.each_ref().map(|plane| plane[pixel]);
    let falloff = seen.falloff.as_ref().map_or(1.0, |falloff| f64::from(falloff[pixel]));
    let tells = falloff > 0.0 && bytes.iter().all(|byte| (DARK..CLIPPED).contains(byte));
    tells.then(|| bytes.iter().map(|byte| f64::from(response.linear_light(*byte))).sum::<f64>() / falloff)
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::PinholeCamera;
    use mba_tracker::image::PixelRectangle;
    use nalgebra::Vector3;

    use super::*;
    use mba_raster::exposure::RowTimes;

    const SIZE: [usize; 2] = [90, 70];

    /// A striped wall at 2 m, seen from x metres, `gain` times as bright.
    fn seen(x: f64, gain: f64) -> Observation {
        let camera =
            PinholeCamera { width: SIZE[0], height: SIZE[1], fx: 80.0, fy: 80.0, cx: 44.5, cy: 34.5 };
        let wall = |pixel: usize| x + camera.ray((pixel % SIZE[0]) as f64, 0.0).x * 2.0;
        let value = |pixel: usize| (gain * (70.0 + 30.0 * (9.0 * wall(pixel)).sin())).min(255.0) as u8;
        let plane: Vec<u8> = (0..SIZE[0] * SIZE[1]).map(value).collect();
        Observation {
            camera,
            colour: [plane.clone(), plane.clone(), plane],
            depth: vec![2.0; SIZE[0] * SIZE[1]],
            region: PixelRectangle { left: 0, top: 0, right: SIZE[0], bottom: SIZE[1] },
            times: RowTimes::GLOBAL,
            falloff: None,
        }
    }

    fn ratio(x: f64, gain: f64) -> Option<f64> {
        let at =
            |x: f64| RigidTransform { translation: Vector3::new(x, 0.0, 0.0), ..RigidTransform::identity() };
        let (one, other) = (seen(0.0, 1.0), seen(x, gain));
        let one = Placed { seen: &one, world_from_camera: at(0.0) };
        let other = Placed { seen: &other, world_from_camera: at(x) };
        log_brightness(&InverseResponse::linear(), one, other)
    }

    #[test]
    fn the_ratio_is_that_of_the_same_surfaces() {
        for gain in [0.5, 1.0, 1.8] {
            let found = ratio(0.3, gain).expect("shared surfaces");
            // Values are cut to whole steps of 35 and more.
            assert!((found - gain.ln()).abs() < 0.015, "{found} for {gain}");
        }
    }

    #[test]
    fn frames_that_share_nothing_and_clipped_light_say_nothing() {
        assert_eq!(ratio(5.0, 1.0), None);
        assert_eq!(ratio(0.3, 10.0), None);
    }
}
