//! Gaussians for viewers of splats.
//!
//! # Colours
//!
//! A map is blended in linear light, as light adds up in a camera. Viewers blend what displays show instead, a curved function
//! of light, so that a pixel to which several Gaussians contribute gets another colour: the same map loses some 3 dB. Display
//! blending is linear in the colours, whatever the weights, and the weights do not depend on the colours. So there are colours
//! for which blended display values come as near as can be to the views of the map: those of a linear least-squares problem,
//! with a row per pixel of some views and an unknown per Gaussian and channel.
//!
//! It is solved by conjugate gradients on the normal equations, for which the matrix is never stored: the rasterizer
//! multiplies with it by rendering, and with its transpose by taking a gradient back.
//!
//! # Sizes
//!
//! A rasterizer makes every splat thicker, by a variance of 0.3 pixels squared, so that none falls between pixels. Where a
//! viewer has more pixels than the recording, or adds less, splats that touched in the recording leave gaps and needles; and
//! viewers cut the border of a splat, which makes it smaller. So most of it is in the Gaussians themselves, measured at
//! the nearest keyframe (as in Yu et al. 2024, Mip-Splatting), for screens with some two pixels along one of the recording.

mod blending;
mod sizes;
mod solve;

use mba_raster::gaussians::{COLOUR, Gaussians};
use mba_raster::raster::RasterImage;
use mba_raster::sensor::DisplayCurve;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::photometric::InverseResponse;
use mba_tracker::simd::Level;

use blending::{Blending, Colours};
use solve::solve;

/// Most pixels of all views together: twelve views of 640 x 480.
const MOST_PIXELS: usize = 12 * 640 * 480;

/// Fewest views, however large they are.
const FEWEST_VIEWS: usize = 8;

/// What of every Gaussian is another one for viewers.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewerSplats {
    /// Display values (0 to 1) of red, green and blue, for which blending of display values gives the views of the map.
    pub colours: [Vec<f32>; 3],
    /// Natural logarithms of the standard deviations along the own axes, metres.
    pub log_scales: [Vec<f32>; 3],
}

/// Colours and sizes for viewers of the Gaussians of `map`.
///
/// `poses` are camera-to-world; an even choice of them is fitted. `response` makes display values of light. Gaussians that no
/// view shows get the display value of their own light. The result does not depend on the number of threads.
#[must_use]
pub fn viewer_splats(
    map: &Gaussians,
    camera: PinholeCamera,
    poses: &[RigidTransform],
    response: &InverseResponse,
    level: Level,
) -> ViewerSplats {
    let curve = DisplayCurve::new(response);
    let mut blending = Blending::new(map, camera, chosen(poses, &camera), level);
    let targets = blending.views(map, |image| shown(image, &curve));
    ViewerSplats {
        colours: solve(&mut blending, display_values(map, &curve), &targets),
        log_scales: sizes::for_screens(map, &sizes::pixel_edges(map, &camera, poses)),
    }
}

/// The display value of every Gaussian's own light.
fn display_values(map: &Gaussians, curve: &DisplayCurve) -> Colours {
    let planes = &map.planes()[COLOUR..];
    core::array::from_fn(|channel| planes[channel].iter().map(|light| display_value(*light, curve)).collect())
}

/// What displays show of light; nothing for what is not finite, which no renderer draws.
fn display_value(light: f32, curve: &DisplayCurve) -> f32 {
    if light.is_finite() { curve.at(light)[0].clamp(0.0, 1.0) } else { 0.0 }
}

/// What displays show of a view.
fn shown(image: &RasterImage, curve: &DisplayCurve) -> Colours {
    image.colour.each_ref().map(|plane| plane.iter().map(|light| display_value(*light, curve)).collect())
}

/// As many poses, evenly chosen, as there may be views.
fn chosen(poses: &[RigidTransform], camera: &PinholeCamera) -> Vec<RigidTransform> {
    let pixels = camera.width.saturating_mul(camera.height).max(1);
    let count = poses.len().min((MOST_PIXELS / pixels).max(FEWEST_VIEWS));
    (0..count).map(|k| poses[k * poses.len() / count]).collect()
}

#[cfg(test)]
mod tests {
    use mba_raster::gaussians::Gaussian;
    use mba_raster::raster::{RasterScratch, RasterView, Rasterizer};
    use mba_tracker::simd::Level;
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 48, height: 36, fx: 50.0, fy: 50.0, cx: 23.5, cy: 17.5 };

    /// A wall of overlapping, half transparent Gaussians, dark and light side by side, and one that no view shows.
    fn wall() -> Gaussians {
        let at = |x: i32, y: i32| Gaussian {
            mean: [0.1 * x as f32, 0.1 * y as f32, 2.0 + 0.003 * ((7 * x + 3 * y) % 5) as f32],
            log_scale: [0.07_f32.ln(), 0.05_f32.ln(), 0.01_f32.ln()],
            rotation: [1.0, 0.0, 0.0, 0.3 * (x % 3) as f32],
            opacity_logit: 0.5 + 0.4 * (y % 4) as f32,
            colour: if (x + y) % 2 == 0 { [0.7, 0.4, 0.9] } else { [0.02, 0.01, 0.2] },
        };
        let wall = (-10..=10).flat_map(|y| (-14..=14).map(move |x| at(x, y)));
        wall.chain([Gaussian { mean: [0.0, 0.0, -3.0], colour: [0.25; 3], ..at(0, 0) }]).collect()
    }

    fn pose(x: f64, turn: f64) -> RigidTransform {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn);
        RigidTransform::new(rotation, Vector3::new(x, 0.03, 0.0))
    }

    /// Root mean square of what blending `colours` differs by from what displays show of the wall, from a pose.
    fn error(map: &Gaussians, colours: &Colours, world_from_camera: RigidTransform) -> f64 {
        let view = RasterView { camera: CAMERA, world_from_camera, background: [0.0; 3] };
        let render = |map: &Gaussians| {
            let mut image = RasterImage::default();
            Rasterizer::new(Level::new()).forward(map, &view, &mut RasterScratch::default(), &mut image);
            image.colour
        };
        let mut painted = map.clone();
        let planes = painted.planes_mut().planes;
        planes
            .into_iter()
            .skip(COLOUR)
            .zip(colours)
            .for_each(|(plane, colour)| plane.copy_from_slice(colour));
        let srgb = |light: f32| {
            if light <= 0.0031308 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
        };
        let (blended, light) = (render(&painted), render(map));
        let squares = blended.iter().flatten().zip(light.iter().flatten());
        let sum: f64 = squares.map(|(shown, light)| f64::from(shown - srgb(*light)).powi(2)).sum();
        (sum / (3 * 48 * 36) as f64).sqrt()
    }

    #[test]
    fn blended_display_values_come_near_to_the_views_of_the_map() {
        let (map, response) = (wall(), InverseResponse::srgb());
        let poses = [pose(-0.2, 0.1), pose(0.0, 0.0), pose(0.2, -0.05), pose(0.1, 0.08)];
        let own = display_values(&map, &DisplayCurve::new(&response));
        let fitted = viewer_splats(&map, CAMERA, &poses, &response, Level::new()).colours;
        // From a pose that is not one of them.
        let error = |colours| error(&map, colours, pose(-0.08, 0.03));
        let [before, after] = [&own, &fitted].map(error);
        assert!(before > 0.05 && after < 0.25 * before, "{before} became {after}");
        assert!(fitted.iter().flatten().all(|colour| (0.0..=1.0).contains(colour)));
        for (own, fitted) in own.iter().zip(&fitted) {
            assert_eq!(own.last(), fitted.last(), "what no view shows keeps its colour");
        }
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let (map, poses) = (wall(), [pose(-0.2, 0.1), pose(0.1, 0.0)]);
        let [one, three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| viewer_splats(&map, CAMERA, &poses, &InverseResponse::srgb(), Level::new()))
        });
        assert_eq!(one, three);
    }

    #[test]
    fn broken_gaussians_and_no_views_are_no_harm() {
        let broken = Gaussian { colour: [f32::NAN, f32::INFINITY, 0.25], ..Gaussian::default() };
        let map: Gaussians = [broken].into_iter().collect();
        let splats = viewer_splats(&map, CAMERA, &[], &InverseResponse::linear(), Level::new());
        let [red, green, blue] = splats.colours;
        assert_eq!((red, green), (vec![0.0], vec![0.0]));
        assert!((blue[0] - 0.25).abs() < 1e-3, "{blue:?}");
    }

    #[test]
    fn large_images_have_fewer_views() {
        let camera = |width| PinholeCamera { width, height: 480, ..CAMERA };
        let count = |width| chosen(&vec![RigidTransform::identity(); 100], &camera(width)).len();
        assert_eq!([count(320), count(640), count(10_000)], [24, 12, 8]);
        assert!(chosen(&[], &camera(640)).is_empty());
    }
}
