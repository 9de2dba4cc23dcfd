//! The furnished room, seen by a camera that moves while its shutter is open.

use mba_mapper::exposure::{ExposurePath, ExposureRenderer, ExposureScratch, ExposureTape, PATH_PARAMETERS};
use mba_mapper::raster::RasterImage;
use mba_tracker::simd::Level;
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{SVector, Vector6};

use crate::raster::RasterInput;

/// Centimetres and a degree of motion: about twelve pixels of blur.
const MOTION: [f64; 6] = [0.01, 0.02, 0.0, 0.02, 0.015, 0.0];

/// A map, an exposure of it, and everything that rendering it needs.
pub struct ExposureInput {
    room: RasterInput,
    path: ExposurePath,
    renderer: ExposureRenderer,
    scratch: ExposureScratch,
    image: RasterImage,
}

impl ExposureInput {
    /// The room of [`RasterInput::room`].
    #[must_use]
    pub fn room(level: Level, count: usize) -> Self {
        let room = RasterInput::room(level, count);
        let motion = Vector6::from(MOTION);
        Self {
            path: ExposurePath::linear(ExposureTrajectory::from_mid_and_motion(
                &room.view.world_from_camera,
                &motion,
            )),
            renderer: ExposureRenderer::new(level),
            scratch: ExposureScratch::default(),
            image: RasterImage::default(),
            room,
        }
    }

    /// Renders the exposure. What is returned takes the gradient back to map and path.
    pub fn forward(&mut self, views: usize) -> ExposureTape<'_> {
        let Self { room, path, renderer, scratch, image } = self;
        let background = room.view.background;
        renderer.forward(&room.gaussians, &room.view.camera, path, views, background, scratch, image)
    }

    /// Renders the exposure and takes the gradient back to map and path.
    pub fn forward_backward(&mut self, views: usize) -> SVector<f64, PATH_PARAMETERS> {
        let Self { room, path, renderer, scratch, image } = self;
        let RasterInput { gaussians, view, grad_image, gradients, .. } = room;
        renderer
            .forward(gaussians, &view.camera, path, views, view.background, scratch, image)
            .backward(grad_image, gradients)
    }
}
