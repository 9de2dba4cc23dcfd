//! Maps of every kind, seen from a pose.

use core::fmt;

use mba_raster::gaussians::Gaussians;
use mba_raster::raster::{RasterImage, RasterScratch, RasterView, Rasterizer};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::simd::Level;

use mba_field::triplane::{FieldRenderer, SamplingSettings, TriplaneField};

/// A map of a kind of its own, which renders itself.
pub trait RenderedMap: fmt::Debug + Sync {
    /// The view of `camera` from a pose: linear light in front of black, depth times alpha in metres, and alpha.
    fn render(&self, camera: &PinholeCamera, world_from_camera: &RigidTransform) -> RasterImage;
}

/// A map that can be looked at.
#[derive(Clone, Copy, Debug)]
pub enum Scene<'a> {
    /// 3D Gaussians.
    Gaussians(&'a Gaussians),
    /// A tri-plane field.
    Field(&'a TriplaneField),
    /// Of any other kind.
    Other(&'a dyn RenderedMap),
}

impl<'a> From<&'a Gaussians> for Scene<'a> {
    fn from(map: &'a Gaussians) -> Self {
        Self::Gaussians(map)
    }
}

impl<'a> From<&'a TriplaneField> for Scene<'a> {
    fn from(map: &'a TriplaneField) -> Self {
        Self::Field(map)
    }
}

/// Renders maps of every kind; memory is kept from view to view.
#[derive(Debug)]
pub struct SceneRenderer {
    rasterizer: Rasterizer,
    field: FieldRenderer,
    scratch: RasterScratch,
    /// The last view: linear light in front of black, depth times alpha in metres, and alpha.
    pub image: RasterImage,
}

impl SceneRenderer {
    /// A renderer with the instruction set `level`; levels differ by rounding only.
    #[must_use]
    pub fn new(level: Level) -> Self {
        Self {
            rasterizer: Rasterizer::new(level),
            field: FieldRenderer::new(level, SamplingSettings::default()),
            scratch: RasterScratch::default(),
            image: RasterImage::default(),
        }
    }

    /// Renders the view of `camera` from a pose into [`Self::image`]. It does not depend on the number of threads.
    pub fn render(&mut self, scene: Scene<'_>, camera: PinholeCamera, world_from_camera: &RigidTransform) {
        match scene {
            Scene::Gaussians(map) => {
                let world_from_camera = *world_from_camera;
                let view = RasterView { camera, world_from_camera, background: [0.0; 3] };
                self.rasterizer.forward(map, &view, &mut self.scratch, &mut self.image);
            }
            Scene::Field(map) => self.image = self.field.render(map, &camera, world_from_camera),
            Scene::Other(map) => self.image = map.render(&camera, world_from_camera),
        }
    }
}
