//! A room corner of textured planes, rendered by ray casting: the images and depth maps are exact at any pose.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule};
use nalgebra::Vector3;

use crate::transfer_scene::Uniform;

/// Raw depth units per metre of the rendered depth images.
pub const DEPTH_SCALE: f64 = 5000.0;

/// Waves of a plane's texture.
const WAVES: usize = 10;

/// A textured plane, as far as `half_size` from its origin along both axes.
#[derive(Clone, Debug)]
struct TexturedPlane {
    origin: Vector3<f64>,
    axes: [Vector3<f64>; 2],
    half_size: f64,
    /// Amplitude, two wave numbers per metre, phase.
    waves: [[f64; 4]; WAVES],
}

/// Planes in the world; the camera starts near its origin and looks along z.
#[derive(Clone, Debug)]
pub struct PlaneScene {
    planes: Vec<TexturedPlane>,
}

/// A sharp view: linear light and depth along the optical axis in metres (0 where nothing is hit).
#[derive(Clone, Debug)]
pub struct SharpView {
    /// Linear light in `[0, 1]`.
    pub light: Vec<f32>,
    /// Depth in metres.
    pub depth: Vec<f32>,
}

impl PlaneScene {
    /// A back wall, a side wall and a floor 2 to 3 m away, and a card of half a metre in front of them; texture
    /// with wavelengths of `finest` metres and up to eight times as long.
    #[must_use]
    pub fn corner(seed: u64, finest: f64) -> Self {
        let mut draw = Uniform::new(seed);
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        let mut plane = |origin, axes, half_size| TexturedPlane {
            origin,
            axes,
            half_size,
            waves: core::array::from_fn(|_| wave(&mut draw, finest)),
        };
        let planes = vec![
            plane(z * 3.0, [x, y], 30.0),
            plane(x * -0.9, [z, y], 30.0),
            plane(y * 0.8, [x, z], 30.0),
            plane(Vector3::new(0.35, 0.1, 2.2), [x, y], 0.25),
        ];
        Self { planes }
    }

    /// What the ray from `origin` along `direction` hits first: light, and the distance in lengths of `direction`.
    fn hit(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<(f64, f64)> {
        let mut nearest: Option<(f64, &TexturedPlane, [f64; 2])> = None;
        for plane in &self.planes {
            let Some((distance, at)) = plane.intersection(origin, direction) else { continue };
            if nearest.is_none_or(|(least, _, _)| distance < least) {
                nearest = Some((distance, plane, at));
            }
        }
        nearest.map(|(distance, plane, at)| (plane.light(at), distance))
    }

    /// The view of `camera` at `world_from_camera`.
    #[must_use]
    pub fn sharp(&self, camera: &PinholeCamera, world_from_camera: &RigidTransform) -> SharpView {
        let rotation = world_from_camera.rotation_matrix();
        let hits = (0..camera.width * camera.height).map(|k| {
            let ray = camera.ray((k % camera.width) as f64, (k / camera.width) as f64);
            // The ray has unit z in the camera, so the distance is the depth.
            self.hit(&world_from_camera.translation, &(rotation * ray)).unwrap_or((0.0, 0.0))
        });
        let (light, depth) = hits.map(|(light, depth)| (light as f32, depth as f32)).unzip();
        SharpView { light, depth }
    }

    /// Linear light averaged over `views` midpoint samples of an exposure.
    #[must_use]
    pub fn blurred(
        &self,
        camera: &PinholeCamera,
        world_from_camera: &ExposureTrajectory,
        views: usize,
    ) -> Vec<f32> {
        let mut sum = vec![0.0; camera.width * camera.height];
        for k in 0..views {
            let view = self.sharp(camera, &world_from_camera.at(SampleRule::Midpoint.time(k, views)));
            for (sum, light) in sum.iter_mut().zip(&view.light) {
                *sum += f64::from(*light);
            }
        }
        sum.iter().map(|sum| (sum / views as f64) as f32).collect()
    }
}

impl TexturedPlane {
    /// Distance along the ray and position on the plane.
    fn intersection(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<(f64, [f64; 2])> {
        let normal = self.axes[0].cross(&self.axes[1]);
        let distance = normal.dot(&(self.origin - origin)) / normal.dot(direction);
        let at = self.axes.map(|axis| axis.dot(&(origin + direction * distance - self.origin)));
        let inside = distance > 0.05 && at.iter().all(|x| x.abs() < self.half_size);
        inside.then_some((distance, at))
    }

    fn light(&self, at: [f64; 2]) -> f64 {
        let sum: f64 =
            self.waves.iter().map(|[a, ku, kv, phase]| a * (ku * at[0] + kv * at[1] + phase).sin()).sum();
        (0.45 + sum).clamp(0.02, 0.95)
    }
}

fn wave(draw: &mut Uniform, finest: f64) -> [f64; 4] {
    let octaves = draw.within(0.0, 3.0);
    let number = core::f64::consts::TAU / (finest * octaves.exp2());
    let angle = draw.within(0.0, core::f64::consts::PI);
    [0.07, number * angle.cos(), number * angle.sin(), draw.within(0.0, core::f64::consts::TAU)]
}

/// Linear light as bytes of a camera with linear response.
#[must_use]
pub fn bytes_of(light: &[f32]) -> Vec<u8> {
    light.iter().map(|x| (x * 255.0).round() as u8).collect()
}

/// Depth in raw units, see [`DEPTH_SCALE`].
#[must_use]
pub fn raw_depth_of(depth: &[f32]) -> Vec<u16> {
    depth.iter().map(|z| (f64::from(*z) * DEPTH_SCALE).round() as u16).collect()
}
