//! The loss of one exposure and all its gradients.

use mba_raster::exposure::{ExposureRenderer, ExposureScratch};
use mba_raster::gaussians::Gaussians;
use mba_raster::losses::{DisplayPlanes, Exposure, ExposureLoss, Ssim, compare_depth};
use mba_raster::raster::{GaussianGradients, RasterImage};
use mba_raster::sensor::{DisplayCurve, Sensor};
use mba_tracker::simd::Level;

use super::schedule::StepPlan;

/// Renders exposures, compares them with what was captured, and takes gradients back. Memory is kept from exposure to
/// exposure.
#[derive(Debug)]
pub struct GaussianLoss {
    curve: DisplayCurve,
    renderer: ExposureRenderer,
    scratch: ExposureScratch,
    image: RasterImage,
    grad_image: RasterImage,
    planes: DisplayPlanes,
    ssim: Ssim,
    gradients: GaussianGradients,
}

impl GaussianLoss {
    /// Memory for it, with the instruction set `level`; levels differ by rounding only.
    #[must_use]
    pub fn new(level: Level, sensor: &Sensor) -> Self {
        Self {
            curve: DisplayCurve::new(&sensor.inverse_response),
            renderer: ExposureRenderer::new(level),
            scratch: ExposureScratch::default(),
            image: RasterImage::default(),
            grad_image: RasterImage::default(),
            planes: DisplayPlanes::default(),
            ssim: Ssim::new(level),
            gradients: GaussianGradients::default(),
        }
    }

    /// The loss of `exposure` with that map; gradients by the map are then in [`Self::gradients`].
    pub fn evaluate(
        &mut self,
        gaussians: &Gaussians,
        exposure: Exposure<'_>,
        plan: &StepPlan,
    ) -> ExposureLoss {
        // Forward: the mean of virtual views, then display values beside the captured ones.
        self.render(gaussians, exposure);
        let Exposure { seen, gain, .. } = exposure;
        let (camera, gain) = (&seen.camera, gain as f32);
        let (scratch, image) = (&mut self.scratch, &mut self.image);
        let mut terms = self.planes.compare(&self.curve, gain, image, seen, plan.weights.colour);
        if plan.weights.similarity > 0.0 {
            let size = [camera.width, camera.height];
            terms.similarity = self.planes.add_similarity(&mut self.ssim, size, plan.weights.similarity);
        }
        self.grad_image.resize(camera.width, camera.height);
        // Backward: from display values to light, from light to Gaussians and path.
        let grad_log_gain = self.planes.gradient_by_light(image, &mut self.grad_image);
        terms.depth = compare_depth(image, seen, &plan.weights, &mut self.grad_image);
        self.gradients.reset(gaussians.len());
        let grad_path = self.renderer.backward(gaussians, &self.grad_image, scratch, &mut self.gradients);
        ExposureLoss { terms, grad_path, grad_log_gain }
    }

    /// The picture of `exposure`, in linear light before the lens and the gain; the loss and its gradients are forgotten.
    pub fn render(&mut self, gaussians: &Gaussians, exposure: Exposure<'_>) -> &RasterImage {
        let Exposure { seen, path, views, .. } = exposure;
        let (scratch, image) = (&mut self.scratch, &mut self.image);
        self.renderer.forward_rows(
            gaussians,
            &seen.camera,
            path,
            &seen.times,
            views,
            [0.0; 3],
            scratch,
            image,
        );
        image
    }

    /// Gradients by the map of the last exposure.
    #[must_use]
    pub fn gradients(&self) -> &GaussianGradients {
        &self.gradients
    }

    /// Which Gaussians the last exposure drew, in any of its views.
    #[must_use]
    pub fn drawn(&self) -> &[bool] {
        self.scratch.drawn_mask()
    }
}
