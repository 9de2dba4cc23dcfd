//! Random transfer problems: images, camera, exposure, patch sites and brightness drawn from a seed.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::image::LevelImage;
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule};
use mba_tracker::transfer::{
    BrightnessModel, PatchSite, ResidualModel, RowDelay, TransferProblem, VirtualView, virtual_views,
};
use nalgebra::Vector6;
use rand_core::Rng;
use rand_pcg::Pcg32;

/// Uniform numbers from raw 32-bit draws, so that no library's distribution decides the test data.
pub struct Uniform(Pcg32);

impl Uniform {
    /// The stream of `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(Pcg32::new(seed, 0x0a02_bdbf_7bb3_c0a7))
    }

    /// A number in `[low, high)`.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.0.next_u32()) / 4_294_967_296.0
    }
}

/// Everything a [`TransferProblem`] borrows.
pub struct TransferScene {
    /// Intrinsics and size of both images.
    pub camera: PinholeCamera,
    /// Sharp reference, linear intensities in `[0, 1]`.
    pub reference: Vec<f32>,
    /// Observed image.
    pub current: Vec<f32>,
    /// `reference_from_camera` over the exposure.
    pub exposure: ExposureTrajectory,
    /// Virtual views of the exposure.
    pub views: Vec<VirtualView>,
    /// Patches, a few of them partly or wholly outside of the images.
    pub sites: Vec<PatchSite>,
    /// Gain near one, small offset.
    pub brightness: BrightnessModel,
}

impl TransferScene {
    /// A scene of `sites` patches and `views` virtual views: up to about 6 degrees of rotation and 5 cm of
    /// translation, depth 0.5 to 6 m.
    #[must_use]
    pub fn random(seed: u64, sites: usize, views: usize) -> Self {
        let mut draw = Uniform::new(seed);
        let camera = random_camera(&mut draw);
        let exposure = ExposureTrajectory::from_mid_and_motion(
            &RigidTransform::identity().perturbed(&random_tangent(&mut draw, 0.05, 0.1)),
            &random_tangent(&mut draw, 0.02, 0.03),
        );
        let reference = smooth_image(&mut draw, &camera);
        let current = smooth_image(&mut draw, &camera);
        let sites = (0..sites).map(|_| random_site(&mut draw, &camera)).collect();
        let brightness =
            BrightnessModel { gain: draw.within(0.8, 1.25) as f32, offset: draw.within(-0.05, 0.05) as f32 };
        let views = virtual_views(&exposure, views, SampleRule::Midpoint, &camera).to_vec();
        Self { camera, reference, current, exposure, views, sites, brightness }
    }

    /// The problem of this scene.
    #[must_use]
    pub fn problem(&self) -> TransferProblem<'_> {
        self.problem_with(&self.views)
    }

    /// The problem of this scene with other virtual views.
    #[must_use]
    pub fn problem_with<'a>(&'a self, views: &'a [VirtualView]) -> TransferProblem<'a> {
        let (width, height) = (self.camera.width, self.camera.height);
        TransferProblem {
            reference: LevelImage { pixels: &self.reference, width, height },
            current: LevelImage { pixels: &self.current, width, height },
            focal: [self.camera.fx as f32, self.camera.fy as f32],
            centre: [self.camera.cx as f32, self.camera.cy as f32],
            views,
            brightness: self.brightness,
            rows: RowDelay::default(),
        }
    }

    /// A noise model with which about half of the residuals lie beyond the Huber threshold.
    #[must_use]
    pub fn residual_model() -> ResidualModel {
        ResidualModel { read_variance: 0.01, photon_variance: 0.02, huber: 1.345 }
    }
}

fn random_camera(draw: &mut Uniform) -> PinholeCamera {
    let width = draw.within(300.0, 641.0) as usize;
    let height = draw.within(200.0, 481.0) as usize;
    let focal = draw.within(0.7, 1.1) * width as f64;
    PinholeCamera {
        width,
        height,
        // Whole numbers are the same in f32 and f64.
        fx: focal.round(),
        fy: (focal * draw.within(0.95, 1.05)).round(),
        cx: (width as f64 * draw.within(0.45, 0.55)).round(),
        cy: (height as f64 * draw.within(0.45, 0.55)).round(),
    }
}

fn random_tangent(draw: &mut Uniform, translation: f64, rotation: f64) -> Vector6<f64> {
    Vector6::from_fn(|i, _| {
        let bound = if i < 3 { translation } else { rotation };
        draw.within(-bound, bound)
    })
}

/// Sum of waves of 15 to 60 pixels: gradients up to about 0.1 per pixel.
fn smooth_image(draw: &mut Uniform, camera: &PinholeCamera) -> Vec<f32> {
    let waves: Vec<[f64; 4]> = (0..4)
        .map(|_| {
            let frequency = core::f64::consts::TAU / draw.within(15.0, 60.0);
            let angle = draw.within(0.0, core::f64::consts::PI);
            [draw.within(0.05, 0.12), frequency * angle.cos(), frequency * angle.sin(), draw.within(0.0, 6.0)]
        })
        .collect();
    let intensity = |u: f64, v: f64| {
        0.5 + waves.iter().map(|[a, ku, kv, phase]| a * (ku * u + kv * v + phase).sin()).sum::<f64>()
    };
    (0..camera.width * camera.height)
        .map(|k| intensity((k % camera.width) as f64, (k / camera.width) as f64) as f32)
        .collect()
}

/// Up to six pixels outside of the image, so that patches straddle its borders.
fn random_site(draw: &mut Uniform, camera: &PinholeCamera) -> PatchSite {
    PatchSite {
        u: draw.within(-6.0, camera.width as f64 + 6.0) as i16,
        v: draw.within(-6.0, camera.height as f64 + 6.0) as i16,
        inverse_depth: (1.0 / draw.within(0.5, 6.0)) as f32,
    }
}
