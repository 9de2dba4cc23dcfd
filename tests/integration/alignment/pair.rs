//! A keyframe and a frame to align with it.

use mba_tests::handheld::camera_of_width;
use mba_tests::plane_scene::{DEPTH_SCALE, PlaneScene, bytes_of, raw_depth_of};
use mba_tracker::SimdLevel;
use mba_tracker::align::{
    AlignScratch, AlignSettings, Alignment, Estimate, FrameData, LevelOutcome, LevelPlan, MotionPrior,
    ReferenceData,
};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::image::{ColourView, DepthView, GreyPyramid, PixelFormat, PixelRectangle};
use mba_tracker::keyframe::{Keyframe, MAX_KEYPOINTS};
use mba_tracker::photometric::{InverseResponse, LuminanceTable, Vignetting};
use mba_tracker::surface::InverseDepthMap;
use mba_tracker::trajectory::{ExposureTrajectory, FrameTiming};
use mba_tracker::transfer::{BrightnessModel, PatchCost, PatchSite};
use mba_tracker::workspace::Arena;
use nalgebra::Vector6;

/// Pyramid levels of the pairs.
const LEVELS: usize = 4;

/// Level of the depth maps.
const DEPTH_LEVEL: usize = 1;

/// Camera of the pairs.
pub(crate) fn camera() -> PinholeCamera {
    camera_of_width(320)
}

/// Encoded images of one view.
#[derive(Clone)]
pub(crate) struct Images {
    pub(crate) grey: Vec<u8>,
    pub(crate) depth: Vec<u16>,
}

impl Images {
    /// A sharp view.
    pub(crate) fn sharp(scene: &PlaneScene, pose: &RigidTransform) -> Self {
        let view = scene.sharp(&camera(), pose);
        Self { grey: bytes_of(&view.light), depth: raw_depth_of(&view.depth) }
    }

    /// A blurred view with the depth of its middle.
    pub(crate) fn blurred(scene: &PlaneScene, path: &ExposureTrajectory) -> Self {
        let grey = bytes_of(&scene.blurred(&camera(), path, 24));
        Self { grey, ..Self::sharp(scene, &path.mid()) }
    }

    fn fill(&self, pyramid: &mut GreyPyramid, depth: &mut InverseDepthMap) {
        let PinholeCamera { width, height, .. } = camera();
        let colour = ColourView::new(&self.grey, width, height, width, PixelFormat::Grey8).expect("grey");
        pyramid.fill(&colour, &LuminanceTable::new(&InverseResponse::linear()), &Vignetting::NONE);
        let raw = DepthView::new(&self.depth, width, height, width).expect("depth");
        depth.fill(SimdLevel::new(), &raw, (1.0 / DEPTH_SCALE) as f32);
    }
}

/// Aligns `frame` with `keyframe` on all levels from `start`, each level from the outcome of the one before. Returns
/// also where the patches were on the finest level.
pub(crate) fn align(
    keyframe_images: &Images,
    frame_images: &Images,
    settings: &AlignSettings,
    start: Estimate,
    prior: &MotionPrior,
) -> (LevelOutcome, Vec<PatchSite>) {
    let camera = camera();
    let region = PixelRectangle { left: 0, top: 0, right: camera.width, bottom: camera.height };
    let mut memory = vec![0; 8 << 20];
    let mut arena = Arena::new(&mut memory);
    let mut keyframe = Keyframe::carve(&mut arena, &camera, LEVELS, DEPTH_LEVEL).expect("memory");
    keyframe_images.fill(&mut keyframe.pyramid, &mut keyframe.depth);
    keyframe.restart_surface(SimdLevel::new());
    keyframe.select(SimdLevel::new(), 0.02, settings.dark_intensity, region);
    let mut pyramid = GreyPyramid::carve(&mut arena, &camera, LEVELS).expect("memory");
    let mut depth = InverseDepthMap::carve(&mut arena, &camera, DEPTH_LEVEL).expect("memory");
    frame_images.fill(&mut pyramid, &mut depth);
    let keypoints = keyframe.keypoints();
    let alignment = Alignment {
        simd: SimdLevel::new(),
        camera,
        reference: ReferenceData {
            levels: &keyframe.pyramid.levels,
            keypoints: &keypoints,
            depth: &keyframe.depth,
            planes: &keyframe.planes,
        },
        frame: FrameData {
            levels: &pyramid.levels,
            depth: &depth,
            depth_level: DEPTH_LEVEL,
            region,
            timing: FrameTiming::GLOBAL,
        },
        expected_brightness: BrightnessModel::default(),
        settings,
    };
    let mut scratch = AlignScratch {
        sites: &mut vec![PatchSite { u: 0, v: 0, inverse_depth: 0.0 }; MAX_KEYPOINTS],
        costs: &mut vec![PatchCost::default(); MAX_KEYPOINTS],
        medians: &mut vec![0.0; 4096],
    };
    let mut outcome = LevelOutcome::unchanged(start);
    for level in (0..LEVELS).rev() {
        let plan =
            LevelPlan { level, depth_stride: 2, max_iterations: 20, min_step: 0.005, blur: settings.blur };
        outcome = alignment.align_level(&plan, outcome.estimate, prior, &mut scratch);
    }
    let sites = scratch.sites[..outcome.patches].to_vec();
    (outcome, sites)
}

/// A belief about the motion with standard deviations in metres and radians.
pub(crate) fn prior(expected: Vector6<f64>, metres: f64, radians: f64) -> MotionPrior {
    let information = Vector6::from_fn(|i, _| if i < 3 { metres.powi(-2) } else { radians.powi(-2) });
    let nothing = Vector6::zeros();
    MotionPrior { expected, information, bow: nothing, bow_information: nothing, follows: None }
}

/// An estimate without gain and offset.
pub(crate) fn estimate(keyframe_from_camera: ExposureTrajectory) -> Estimate {
    Estimate::linear(keyframe_from_camera)
}
