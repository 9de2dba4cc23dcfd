//! Virtual views, their mean, and the way back.

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule};
use nalgebra::{SMatrix, Vector6};
use rayon::prelude::*;

use super::scratch::{ExposureScratch, VirtualView};
use crate::gaussians::Gaussians;
use crate::raster::{GaussianGradients, RasterImage, RasterView, Rasterizer};

/// Renders virtual views along an exposure, averages them in linear light, and takes gradients back.
#[derive(Clone, Copy, Debug)]
pub struct ExposureRenderer {
    rasterizer: Rasterizer,
}

/// Gradient of a loss by the poses at shutter opening and closing.
///
/// Both by the tangent of [`mba_tracker::geometry::RigidTransform::perturbed`]: translation in the world, metres,
/// then rotation in the camera frame, radians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExposureGradient {
    /// By the pose at opening.
    pub start: Vector6<f64>,
    /// By the pose at closing.
    pub end: Vector6<f64>,
}

impl ExposureRenderer {
    /// A renderer with the instruction set `level`; levels differ by rounding only.
    #[must_use]
    pub fn new(level: Level) -> Self {
        Self { rasterizer: Rasterizer::new(level) }
    }

    /// Renders an exposure into `image`, which gets the size of the camera.
    ///
    /// `path` holds poses `world_from_camera`. Colour is the mean of `views` virtual views at the times of
    /// [`SampleRule::Midpoint`], over `background`, linear RGB; depth and alpha are those of the view at mid
    /// exposure. So that there is such a view, an even number of views counts as the next odd one, and none as one.
    #[expect(clippy::too_many_arguments, reason = "inputs of one image, and where the results go")]
    pub fn forward(
        &self,
        gaussians: &Gaussians,
        camera: &PinholeCamera,
        path: &ExposureTrajectory,
        views: usize,
        background: [f64; 3],
        scratch: &mut ExposureScratch,
        image: &mut RasterImage,
    ) {
        let views = views | 1;
        scratch.reset(views);
        scratch.used_mut().par_iter_mut().enumerate().for_each(|(k, view)| {
            let time = SampleRule::Midpoint.time(k, views);
            view.world_from_camera = path.at(time);
            view.by_ends = path.pose_jacobian(time);
            let raster_view =
                RasterView { camera: *camera, world_from_camera: view.world_from_camera, background };
            self.rasterizer.forward(gaussians, &raster_view, &mut view.raster, &mut view.image);
        });
        scratch.drawn.clear();
        scratch.drawn.resize(gaussians.len(), false);
        for view in &scratch.views[..views] {
            scratch.drawn.iter_mut().enumerate().for_each(|(k, drawn)| *drawn |= view.raster.is_drawn(k));
        }
        store_mean(scratch.used_mut(), image);
    }

    /// Adds the gradients of a loss to `gradients`, which has the length of `gaussians`, and returns the gradient
    /// by the poses at both ends. `by_image` is the gradient by the image of the last call of [`Self::forward`],
    /// which had the same Gaussians and the same scratch memory.
    ///
    /// [`GaussianGradients::screen`] gets the sum over the virtual views of the lengths of their gradients: the
    /// share of every view in the image is already in them, so that it compares for any number of views.
    ///
    /// Gaussians and images of other sizes than in that call give no gradient.
    pub fn backward(
        &self,
        gaussians: &Gaussians,
        by_image: &RasterImage,
        scratch: &mut ExposureScratch,
        gradients: &mut GaussianGradients,
    ) -> ExposureGradient {
        let mut by_ends = SMatrix::<f64, 12, 1>::zeros();
        let views = scratch.used;
        let mut by_view = by_image.clone();
        by_view.colour.iter_mut().flatten().for_each(|value| *value /= views as f32);
        let mut geometry = [core::mem::take(&mut by_view.depth), core::mem::take(&mut by_view.alpha)];
        for (k, view) in scratch.used_mut().iter_mut().enumerate() {
            let is_mid = k == views / 2;
            let zeros = || vec![0.0; by_image.depth.len()];
            [by_view.depth, by_view.alpha] =
                if is_mid { core::mem::take(&mut geometry) } else { [zeros(), zeros()] };
            let by_pose = self.rasterizer.backward(gaussians, &by_view, &mut view.raster, gradients);
            by_ends += view.by_ends.transpose() * by_pose.tangent(&view.world_from_camera);
        }
        ExposureGradient {
            start: by_ends.fixed_rows::<6>(0).into_owned(),
            end: by_ends.fixed_rows::<6>(6).into_owned(),
        }
    }
}

/// The mean colour of the views, with the depth and alpha of the one in the middle.
fn store_mean(views: &[VirtualView], image: &mut RasterImage) {
    image.clone_from(&views[views.len() / 2].image);
    for (channel, plane) in image.colour.iter_mut().enumerate() {
        for (pixel, value) in plane.iter_mut().enumerate() {
            let sum: f32 = views.iter().map(|view| view.image.colour[channel][pixel]).sum();
            *value = sum / views.len() as f32;
        }
    }
}
