//! Access to `data/raster_golden`: rendered images and exact gradients of small scenes, computed in f64 by a dense
//! renderer with automatic differentiation and checked against a published renderer.
//!
//! Depth in the files is that of the centres, as the published renderer has it. The project composites the depth on the
//! ray of the pixel, and what it makes of a number per Gaussian, such as the z of its centre, is a colour: the files'
//! depth is the red of a second rendering, and their loss and gradients are sums over both.

use mba_mapper::raster::RasterView;
use mba_mapper::raster::reference::{
    ReferenceGaussian, ReferenceGradient, ReferenceGradients, ReferencePixelGradient,
};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde_json::Value;

/// Errors that a careful f32 renderer makes: of the image absolutely, of each gradient relative to its largest
/// entry.
pub struct FloatErrors {
    /// Of the colour.
    pub colour: f64,
    /// Of the depth.
    pub depth: f64,
    /// By the centres.
    pub means: f64,
    /// By the quaternions.
    pub rotations: f64,
    /// By the scales.
    pub scales: f64,
    /// By the opacities.
    pub opacities: f64,
    /// By the colours.
    pub colours: f64,
    /// By the twelve numbers of the view.
    pub view: f64,
    /// By the left tangent of the view.
    pub pose_left: f64,
}

/// One scene.
pub struct GoldenScene {
    /// Its name.
    pub name: &'static str,
    /// Errors of a renderer in f32, measured with a published one.
    pub float_errors: FloatErrors,
    file: Value,
}

const NAMES_TEXTS_ERRORS: [(&str, &str, [f64; 9]); 3] = [
    (
        "single",
        include_str!("../data/raster_golden/single.json"),
        [1e-7, 3e-7, 4e-7, 3e-6, 5e-6, 2e-5, 3e-7, 4e-7, 4e-7],
    ),
    (
        "base",
        include_str!("../data/raster_golden/base.json"),
        [1e-6, 3e-6, 3e-6, 3e-6, 2e-6, 8e-7, 8e-7, 1e-6, 5e-6],
    ),
    (
        "hard",
        include_str!("../data/raster_golden/hard.json"),
        [1e-6, 3e-6, 3e-6, 2e-6, 2e-5, 6e-7, 2e-6, 4e-6, 4e-6],
    ),
];

/// All scenes.
///
/// # Panics
///
/// If a file is not JSON.
#[must_use]
pub fn scenes() -> Vec<GoldenScene> {
    let scene = |(name, text, e): (&'static str, &str, [f64; 9])| {
        let float_errors = FloatErrors {
            colour: e[0],
            depth: e[1],
            means: e[2],
            rotations: e[3],
            scales: e[4],
            opacities: e[5],
            colours: e[6],
            view: e[7],
            pose_left: e[8],
        };
        GoldenScene { name, float_errors, file: serde_json::from_str(text).expect("the file is valid JSON") }
    };
    NAMES_TEXTS_ERRORS.map(scene).into()
}

/// A view, and the gradient by its pixels.
pub struct GoldenRendering {
    /// The view.
    pub view: RasterView,
    /// The Gaussians.
    pub gaussians: Vec<ReferenceGaussian>,
    /// Gradient of the loss by the pixels.
    pub grad_pixels: ReferencePixelGradient,
}

/// A gradient by colour only.
fn grad_colour(colour: Vec<Vector3<f64>>) -> ReferencePixelGradient {
    let zeros = vec![0.0; colour.len()];
    ReferencePixelGradient { depth: zeros.clone(), alpha: zeros, colour }
}

impl GoldenScene {
    /// The camera. The files put the centre of the top-left pixel at (0.5, 0.5), the project at (0, 0).
    #[must_use]
    pub fn view(&self) -> RasterView {
        let camera = &self.file["camera"];
        let number = |key: &str| camera[key].as_f64().expect("the camera has this number");
        let matrix = numbers(&self.file["view"]);
        let rotation = Matrix3::from_fn(|i, j| matrix[4 * i + j]);
        let camera_from_world = RigidTransform::new(
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)),
            Vector3::from_fn(|i, _| matrix[4 * i + 3]),
        );
        RasterView {
            camera: PinholeCamera {
                width: number("width") as usize,
                height: number("height") as usize,
                fx: number("fx"),
                fy: number("fy"),
                cx: number("cx") - 0.5,
                cy: number("cy") - 0.5,
            },
            world_from_camera: camera_from_world.inverse(),
            background: triple(&numbers(&camera["background"])).into(),
        }
    }

    /// The Gaussians.
    #[must_use]
    pub fn gaussians(&self) -> Vec<ReferenceGaussian> {
        let of = |key: &str| numbers(&self.file["gaussians"][key]);
        let (means, quats, scales) = (of("means"), of("quats"), of("scales"));
        let (opacities, colours) = (of("opacities"), of("colors"));
        (0..opacities.len())
            .map(|i| ReferenceGaussian {
                mean: triple(&means[3 * i..]),
                scale: triple(&scales[3 * i..]),
                rotation: core::array::from_fn(|k| quats[4 * i + k]),
                opacity: opacities[i],
                colour: triple(&colours[3 * i..]),
            })
            .collect()
    }

    /// The rendering of colour and alpha, and the one whose red is the depth.
    #[must_use]
    pub fn renderings(&self) -> [GoldenRendering; 2] {
        let (view, gaussians) = (self.view(), self.gaussians());
        let of_colour = numbers(&self.file["weights"]["w"]).chunks_exact(3).map(triple).collect();
        let red = |value: f64| Vector3::new(value, 0.0, 0.0);
        let of_depth = numbers(&self.file["weights"]["v"]).into_iter().map(red).collect();
        let camera_from_world = view.world_from_camera.inverse();
        let with_depth = |gaussian: &ReferenceGaussian| ReferenceGaussian {
            colour: red(camera_from_world.transform_point(&gaussian.mean).z),
            ..*gaussian
        };
        let depths = gaussians.iter().map(with_depth).collect();
        [
            GoldenRendering { view, gaussians, grad_pixels: grad_colour(of_colour) },
            GoldenRendering {
                view: RasterView { background: [0.0; 3], ..view },
                gaussians: depths,
                grad_pixels: grad_colour(of_depth),
            },
        ]
    }

    /// The gradients of the file's loss from those of [`Self::renderings`]. The z of a centre is a number of the
    /// transformation to the camera and of the centre.
    #[must_use]
    pub fn total(&self, [colour, depth]: &[ReferenceGradients; 2]) -> ReferenceGradients {
        let rotation = self.view().world_from_camera.inverse().rotation_matrix();
        let mut view = colour.view;
        view.rotation += depth.view.rotation;
        view.translation += depth.view.translation;
        let mut gaussians = Vec::new();
        for ((one, other), gaussian) in colour.gaussians.iter().zip(&depth.gaussians).zip(self.gaussians()) {
            let grad_z = other.colour.x;
            let of_centre = grad_z * gaussian.mean.transpose();
            view.rotation.set_row(2, &(view.rotation.row(2) + of_centre));
            view.translation.z += grad_z;
            let mut sum = ReferenceGradient {
                mean: one.mean + other.mean + grad_z * rotation.row(2).transpose(),
                scale: one.scale + other.scale,
                rotation: core::array::from_fn(|k| one.rotation[k] + other.rotation[k]),
                opacity: one.opacity + other.opacity,
                ..*one
            };
            sum.splat.centre += other.splat.centre;
            sum.splat.depth += grad_z;
            (0..3).for_each(|k| sum.splat.conic[k] += other.splat.conic[k]);
            gaussians.push(sum);
        }
        ReferenceGradients { gaussians, view }
    }

    /// An output image, row by row: `rgb`, `depth`, `alpha` or `contributions`.
    #[must_use]
    pub fn image(&self, key: &str) -> Vec<f64> {
        numbers(&self.file["image"][key])
    }

    /// Asserts that a gradient deviates from that of the file by at most `tolerance` times its largest entry.
    ///
    /// # Panics
    ///
    /// If it does not.
    pub fn assert_gradient(&self, key: &str, got: impl IntoIterator<Item = f64>, tolerance: f64) {
        let want = numbers(&self.file["gradients"][key]);
        let largest = want.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        self.assert_close(key, got, &want, tolerance * largest);
    }

    /// Asserts that an image deviates from that of the file by at most `tolerance`.
    ///
    /// # Panics
    ///
    /// If it does not.
    pub fn assert_image(&self, key: &str, got: impl IntoIterator<Item = f64>, tolerance: f64) {
        self.assert_close(key, got, &self.image(key), tolerance);
    }

    fn assert_close(&self, key: &str, got: impl IntoIterator<Item = f64>, want: &[f64], bound: f64) {
        let got: Vec<f64> = got.into_iter().collect();
        assert_eq!(got.len(), want.len(), "{}: {key} has another size", self.name);
        let worst = got.iter().zip(want).map(|(g, w)| (g - w).abs()).enumerate();
        let (at, error) = worst.max_by(|a, b| a.1.total_cmp(&b.1)).expect("not empty");
        println!("{}: {key}: error {error:.2e} of {bound:.2e}", self.name);
        assert!(error <= bound, "{}: {key} {at}: {} instead of {}", self.name, got[at], want[at]);
    }
}

fn triple(values: &[f64]) -> Vector3<f64> {
    Vector3::new(values[0], values[1], values[2])
}

/// All numbers of a scalar, an array or an array of arrays, in order.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(entries) => entries.iter().flat_map(numbers).collect(),
        other => other.as_f64().into_iter().collect(),
    }
}
