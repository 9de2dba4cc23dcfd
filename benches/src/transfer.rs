//! A transfer problem at 640x480: wavy texture, an exposure of a shaking hand, patches all over the image.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::image::LevelImage;
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule};
use mba_tracker::transfer::{
    BrightnessModel, PatchSite, ResidualModel, RowDelay, TransferProblem, VirtualView, virtual_views,
};
use nalgebra::Vector6;

/// Noise of a typical camera in linear light and the usual 95 % efficiency threshold.
pub const RESIDUAL_MODEL: ResidualModel =
    ResidualModel { read_variance: 1e-4, photon_variance: 1e-3, huber: 1.345 };

const CAMERA: PinholeCamera =
    PinholeCamera { width: 640, height: 480, fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5 };

/// Everything a [`TransferProblem`] borrows.
pub struct TransferInput {
    reference: Vec<f32>,
    current: Vec<f32>,
    views: Vec<VirtualView>,
    /// 300 patches whose samples all lie inside of the reference image.
    pub sites: Vec<PatchSite>,
}

impl TransferInput {
    /// The problem with `views` virtual views along about 12 pixels of blur.
    #[must_use]
    pub fn new(views: usize) -> Self {
        let mid = RigidTransform::identity().perturbed(&Vector6::new(0.01, -0.02, 0.01, 0.01, 0.02, -0.01));
        let motion = Vector6::new(0.004, 0.003, -0.002, 0.012, -0.018, 0.006);
        let exposure = ExposureTrajectory::from_mid_and_motion(&mid, &motion);
        Self {
            reference: wavy_image(0.0),
            current: wavy_image(0.4),
            views: virtual_views(&exposure, views, SampleRule::Midpoint, &CAMERA).to_vec(),
            sites: (0..300).map(site).collect(),
        }
    }

    /// The problem of this input.
    #[must_use]
    pub fn problem(&self) -> TransferProblem<'_> {
        let image = |pixels| LevelImage { pixels, width: CAMERA.width, height: CAMERA.height };
        TransferProblem {
            reference: image(&self.reference),
            current: image(&self.current),
            focal: [CAMERA.fx as f32, CAMERA.fy as f32],
            centre: [CAMERA.cx as f32, CAMERA.cy as f32],
            views: &self.views,
            brightness: BrightnessModel { gain: 1.02, offset: -0.01 },
            rows: RowDelay::default(),
        }
    }
}

fn wavy_image(phase: f32) -> Vec<f32> {
    let intensity = |u: f32, v: f32| {
        0.5 + 0.2 * (0.31 * u + 0.11 * v + phase).sin() + 0.2 * (0.23 * v - 0.17 * u + phase).sin()
    };
    (0..CAMERA.width * CAMERA.height)
        .map(|k| intensity((k % CAMERA.width) as f32, (k / CAMERA.width) as f32))
        .collect()
}

/// Site `k` of a grid of 20 by 15, shuffled so that neighbours in memory are not neighbours in the image.
fn site(k: usize) -> PatchSite {
    let cell = k * 91 % 300;
    PatchSite {
        u: (64 + cell % 20 * 26) as i16,
        v: (56 + cell / 20 * 26) as i16,
        inverse_depth: 0.3 + 0.001 * cell as f32,
    }
}
