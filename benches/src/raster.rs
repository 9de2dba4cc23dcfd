//! A furnished room of flat Gaussians, as a mapping system seeds them, and a view of it at 640x480.

use core::f64::consts::TAU;

use mba_mapper::gaussians::{Gaussian, Gaussians};
use mba_mapper::raster::{GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::simd::Level;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Half of width, depth and height of the room, metres.
const ROOM: [f64; 3] = [3.0, 2.0, 1.5];

/// Middle and half of width, depth and height of the furniture, metres.
const FURNITURE: [([f64; 3], [f64; 3]); 3] = [
    ([1.2, -0.2, -1.1], [0.6, 0.4, 0.4]),
    ([2.5, 1.4, -0.5], [0.4, 0.5, 1.0]),
    ([-0.5, 1.3, -1.2], [0.4, 0.4, 0.3]),
];

/// Numbers of a multiplicative congruential generator (Park and Miller 1988).
struct Uniform(u64);

impl Uniform {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0 * 48_271 % 2_147_483_647;
        low + (high - low) * self.0 as f64 / 2_147_483_647.0
    }
}

/// A map, a view of it, and everything the stages need.
pub struct RasterInput {
    /// The map.
    pub gaussians: Gaussians,
    /// The view.
    pub view: RasterView,
    /// The rasterizer.
    pub rasterizer: Rasterizer,
    /// Its memory, filled by a whole pass.
    pub scratch: RasterScratch,
    /// The rendered view.
    pub image: RasterImage,
    /// Gradient by its pixels.
    pub grad_image: RasterImage,
    /// Gradients by the map.
    pub gradients: GaussianGradients,
}

impl RasterInput {
    /// A room of `count` Gaussians that covers the same area whatever their number.
    #[must_use]
    pub fn room(level: Level, count: usize) -> Self {
        let mut uniform = Uniform(20_240_611);
        Self::new(level, (0..count).map(|_| wall_splat(&mut uniform, count)).collect())
    }

    /// `count` Gaussians over the whole view with a standard deviation of `sigma` pixels at 2 m.
    #[must_use]
    pub fn cloud(level: Level, count: usize, sigma: f64) -> Self {
        let mut uniform = Uniform(7);
        let scale = (sigma * 2.0 / 500.0).ln() as f32;
        let mut gaussian = || {
            let across = [uniform.within(-1.4, 1.4), uniform.within(-1.0, 1.0), uniform.within(1.99, 2.01)];
            Gaussian {
                mean: view().world_from_camera.transform_point(&across.into()).map(|x| x as f32).into(),
                log_scale: [scale; 3],
                rotation: [1.0, 0.0, 0.0, 0.0],
                // Faint, so that nothing is hidden: opacity 0.02.
                opacity_logit: -3.9,
                colour: [0.5; 3],
            }
        };
        Self::new(level, (0..count).map(|_| gaussian()).collect())
    }

    fn new(level: Level, gaussians: Gaussians) -> Self {
        let view = view();
        let mut grad_image = RasterImage::zeros(view.camera.width, view.camera.height);
        let planes = grad_image.colour.iter_mut().chain([&mut grad_image.depth, &mut grad_image.alpha]);
        for (plane, k) in planes.zip(1_u8..) {
            let wave = |pixel: usize| (pixel as f32 * 0.37 * f32::from(k)).sin();
            plane.iter_mut().enumerate().for_each(|(pixel, value)| *value = wave(pixel));
        }
        let mut input = Self {
            gradients: GaussianGradients::zeros(gaussians.len()),
            rasterizer: Rasterizer::new(level),
            scratch: RasterScratch::default(),
            image: RasterImage::default(),
            gaussians,
            view,
            grad_image,
        };
        input.forward_backward();
        input
    }

    /// Renders the view.
    pub fn forward(&mut self) {
        self.rasterizer.forward(&self.gaussians, &self.view, &mut self.scratch, &mut self.image);
    }

    /// Renders the view and takes the gradient back to map and pose.
    pub fn forward_backward(&mut self) {
        let Self { rasterizer, gaussians, view, grad_image, scratch, image, gradients } = self;
        rasterizer.forward(gaussians, view, scratch, image).backward(grad_image, gradients);
    }
}

/// From the middle of a wall across the room, slightly down.
fn view() -> RasterView {
    let forward = Vector3::new(1.0, 0.05, -0.12).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let axes = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
    RasterView {
        camera: PinholeCamera { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5 },
        world_from_camera: RigidTransform::new(
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)),
            Vector3::new(-2.45, -0.2, 0.0),
        ),
        background: [0.0; 3],
    }
}

/// A flat Gaussian on a surface of the room or its furniture.
fn wall_splat(uniform: &mut Uniform, count: usize) -> Gaussian {
    let (middle, half) = match uniform.within(0.0, 10.0) as usize {
        piece @ 0..3 => FURNITURE[piece],
        _ => ([0.0; 3], ROOM),
    };
    // A box has its faces by area.
    let areas = [half[1] * half[2], half[0] * half[2], half[0] * half[1]];
    let draw = uniform.within(0.0, areas.iter().sum());
    let normal = if draw < areas[0] { 0 } else { 1 + usize::from(draw >= areas[0] + areas[1]) };
    let side = uniform.within(-1.0, 1.0).signum();
    let mut mean = [0, 1, 2].map(|k| middle[k] + half[k] * uniform.within(-1.0, 1.0));
    mean[normal] = middle[normal] + half[normal] * side;

    let spread = (50_000.0 / count as f64).sqrt();
    let [a, b] = [(); 2].map(|()| uniform.within(0.015_f64.ln(), 0.04_f64.ln()).exp() * spread);
    let mut scale = [a, b, b];
    scale.swap(0, (normal + 1) % 3);
    scale[normal] = 0.25 * (a * b).sqrt();
    let half_turn = 0.5 * uniform.within(0.0, TAU);
    let mut rotation = [half_turn.cos() as f32, 0.0, 0.0, 0.0];
    rotation[1 + normal] = half_turn.sin() as f32;
    let opacity = uniform.within(0.3, 0.95);
    Gaussian {
        mean: mean.map(|x| x as f32),
        log_scale: scale.map(|s| s.ln() as f32),
        rotation,
        opacity_logit: (opacity / (1.0 - opacity)).ln() as f32,
        colour: [(); 3].map(|()| uniform.within(0.1, 0.9) as f32),
    }
}
