//! Joint optimisation of the map and of the exposure trajectories.

use mba_tracker::geometry::RigidTransform;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::ExposureTrajectory;

use super::adam::{self, Moments, StepLengths};
use super::density::{self, Pull};
use super::display::DisplayCurve;
use super::keyframe::{ObservationPyramid, Sensor};
use super::loss::{DisplayPlanes, LossTerms, LossWeights, compare_depth};
use super::pose_step::{PoseMoments, PoseUnits};
use super::seeding;
use crate::exposure::{ExposureRenderer, ExposureScratch};
use crate::gaussians::Gaussians;
use crate::losses::Ssim;
use crate::raster::{GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer};

/// A frame that the map is fitted to.
#[derive(Clone, Debug)]
pub struct Keyframe {
    /// Index in the data set.
    pub index: usize,
    /// What was captured.
    pub observation: ObservationPyramid,
    /// `world_from_camera` at both ends of the exposure.
    pub path: ExposureTrajectory,
    /// Logarithm of the gain on the map's light.
    pub log_gain: f64,
    /// Length of the blur at full resolution, pixels.
    pub blur_px: f64,
    /// Moments of the pose's gradients.
    pub moments: PoseMoments,
}

/// How one step is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepPlan {
    /// Resolution, 0 is full.
    pub level: usize,
    /// Distance of virtual views along the blur, pixels of the level.
    pub spacing: f64,
    /// Most virtual views.
    pub max_views: usize,
    /// Step lengths of the Gaussians.
    pub lengths: StepLengths,
    /// Step length of poses, pixels at full resolution; 0 leaves poses alone.
    pub pose_pixels: f64,
    /// Weights of the losses.
    pub weights: LossWeights,
}

/// Everything that one step needs besides the state.
pub struct BundleAdjustment {
    /// The map.
    pub gaussians: Gaussians,
    /// Moments of its gradients.
    pub moments: Moments,
    /// Pulls since the last change of density.
    pub pull: Pull,
    /// The frames.
    pub keyframes: Vec<Keyframe>,
    sensor: Sensor,
    curve: DisplayCurve,
    renderer: ExposureRenderer,
    rasterizer: Rasterizer,
    scratch: ExposureScratch,
    mid_scratch: RasterScratch,
    image: RasterImage,
    by_image: RasterImage,
    planes: DisplayPlanes,
    ssim: Ssim,
    gradients: GaussianGradients,
}

impl BundleAdjustment {
    /// Prepares for keyframes of one sensor, with an empty map.
    #[must_use]
    pub fn new(level: Level, sensor: Sensor, keyframes: Vec<Keyframe>) -> Self {
        let curve = DisplayCurve::new(&sensor.inverse_response);
        Self {
            gaussians: Gaussians::default(),
            moments: Moments::default(),
            pull: Pull::default(),
            keyframes,
            sensor,
            curve,
            renderer: ExposureRenderer::new(level),
            rasterizer: Rasterizer::new(level),
            scratch: ExposureScratch::default(),
            mid_scratch: RasterScratch::default(),
            image: RasterImage::default(),
            by_image: RasterImage::default(),
            planes: DisplayPlanes::default(),
            ssim: Ssim::new(level),
            gradients: GaussianGradients::default(),
        }
    }

    /// Number of virtual views of keyframe `k` under a plan; odd.
    #[must_use]
    pub fn views(&self, k: usize, plan: &StepPlan) -> usize {
        let blur = self.keyframes[k].blur_px / (1_usize << plan.level) as f64;
        ((blur / plan.spacing).ceil() as usize).clamp(1, plan.max_views.max(1)) | 1
    }

    /// Adds Gaussians where keyframe `k` sees something that the map does not have.
    pub fn seed(&mut self, k: usize, level: usize, room: usize) -> usize {
        let keyframe = &self.keyframes[k];
        let seen = keyframe.observation.level(level);
        let middle = keyframe.path.mid();
        let view = RasterView { camera: seen.camera, world_from_camera: middle, background: [0.0; 3] };
        self.rasterizer.forward(&self.gaussians, &view, &mut self.mid_scratch, &mut self.image);
        let response = &self.sensor.inverse_response;
        let added = seeding::seed(&mut self.gaussians, seen, response, &middle, &self.image.alpha, room);
        density::resize(&mut self.moments, self.gaussians.len());
        self.pull = Pull::zeros(self.gaussians.len());
        added
    }

    /// Renders the sharp view of a pose at full resolution.
    pub fn render(&mut self, world_from_camera: &RigidTransform, image: &mut RasterImage) {
        let view =
            RasterView { camera: self.sensor.camera, world_from_camera: *world_from_camera, background: [0.0; 3] };
        self.rasterizer.forward(&self.gaussians, &view, &mut self.mid_scratch, image);
    }

    /// One step on keyframe `k`.
    pub fn step(&mut self, k: usize, plan: &StepPlan) -> LossTerms {
        let views = self.views(k, plan);
        let keyframe = &mut self.keyframes[k];
        let seen = keyframe.observation.level(plan.level);
        let gain = keyframe.log_gain.exp() as f32;
        let (camera, path) = (&seen.camera, &keyframe.path);
        self.renderer.forward(
            &self.gaussians,
            camera,
            path,
            views,
            [0.0; 3],
            &mut self.scratch,
            &mut self.image,
        );
        self.by_image.resize(camera.width, camera.height);
        let mut terms =
            self.planes.compare(&self.curve, gain, &self.image, seen, plan.weights.colour);
        if plan.weights.similarity > 0.0 {
            let DisplayPlanes { rendered, captured, gradient, .. } = &mut self.planes;
            
            
            let value = self.ssim.add_gradient(
                [camera.width, camera.height],
                captured.each_ref().map(Vec::as_slice),
                rendered.each_ref().map(Vec::as_slice),
                -plan.weights.similarity,
                gradient.each_mut().map(Vec::as_mut_slice),
            );
            terms.similarity = f64::from(plan.weights.similarity) * (1.0 - value);
        }
        let by_gain = self.planes.gradient_by_light(gain, &self.image, &mut self.by_image);
        terms.depth = compare_depth(&self.image, seen, &plan.weights, &mut self.by_image);
        self.gradients.reset(self.gaussians.len());
        let by_path =
            self.renderer.backward(&self.gaussians, &self.by_image, &mut self.scratch, &mut self.gradients);
        let scratch = &self.scratch;
        adam::step(
            &mut self.gaussians,
            &self.gradients.parameters,
            &|i| scratch.is_drawn(i),
            &plan.lengths,
            &mut self.moments,
        );
        self.pull.add(&self.gradients.screen, |i| scratch.is_drawn(i));
        let _ = by_gain;
        if plan.pose_pixels > 0.0 {
            let units = PoseUnits { metres: 3.0 / self.sensor.camera.fx, radians: 1.0 / self.sensor.camera.fx };
            keyframe.moments.step(&mut keyframe.path, &by_path, units, plan.pose_pixels, false);
        }
        terms
    }

    /// Changes the density: divides at most `room` Gaussians, removes those that do nothing, restores the order.
    pub fn change_density(&mut self, threshold: f32, room: usize) -> [usize; 2] {
        let divided = density::divide(&mut self.gaussians, &mut self.moments, &self.pull, threshold, room);
        let pruned = density::prune(&mut self.gaussians, &mut self.moments);
        self.reorder();
        [divided, pruned]
    }

    /// Puts neighbours in space next to each other in memory.
    pub fn reorder(&mut self) {
        let order = density::morton_order(&self.gaussians);
        density::select(&mut self.gaussians, &mut self.moments, &order);
        self.pull = Pull::zeros(self.gaussians.len());
    }
}
