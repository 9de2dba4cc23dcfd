//! The loss of one exposure and all its gradients.

use mba_raster::exposure::{ExposureRenderer, ExposureScratch, ExposureTape};
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
        let Self { curve, renderer, scratch, image, grad_image, planes, ssim, gradients } = self;
        let mut tape = rendered(renderer, gaussians, exposure, scratch, image);
        let Exposure { seen, gain, .. } = exposure;
        let (camera, gain) = (&seen.camera, gain as f32);
        let mut terms = planes.compare(curve, gain, image, seen, plan.weights.colour);
        if plan.weights.similarity > 0.0 {
            let size = [camera.width, camera.height];
            terms.similarity = planes.add_similarity(ssim, size, plan.weights.similarity);
        }
        grad_image.resize(camera.width, camera.height);
        // Backward: from display values to light, from light to Gaussians and path.
        let grad_log_gain = planes.gradient_by_light(image, grad_image);
        terms.depth = compare_depth(image, seen, &plan.weights, grad_image);
        gradients.reset(gaussians.len());
        let grad_path = tape.backward(grad_image, gradients);
        ExposureLoss { terms, grad_path, grad_log_gain }
    }

    /// The picture of `exposure`, in linear light before the lens and the gain; the loss and its gradients are forgotten.
    pub fn render(&mut self, gaussians: &Gaussians, exposure: Exposure<'_>) -> &RasterImage {
        rendered(&self.renderer, gaussians, exposure, &mut self.scratch, &mut self.image);
        &self.image
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

/// Renders `exposure` into `image`.
fn rendered<'a>(
    renderer: &ExposureRenderer,
    gaussians: &'a Gaussians,
    exposure: Exposure<'_>,
    scratch: &'a mut ExposureScratch,
    image: &mut RasterImage,
) -> ExposureTape<'a> {
    let Exposure { seen, path, views, .. } = exposure;
    renderer.forward_rows(gaussians, &seen.camera, path, &seen.times, views, [0.0; 3], scratch, image)
}
