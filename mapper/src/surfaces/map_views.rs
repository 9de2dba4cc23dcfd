//! A map of Gaussians as cameras see it.

use mba_tracker::SimdLevel;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};

use super::{DepthView, ViewSource};
use crate::gaussians::Gaussians;
use crate::raster::{RasterImage, RasterScratch, RasterView, Rasterizer};

/// Depth is used where the map hides at least this share of what is behind it.
const OPAQUE: f32 = 0.5;

/// Views of a map from given poses, rendered whenever they are asked for.
#[derive(Debug)]
pub struct MapViews<'a> {
    map: &'a Gaussians,
    camera: PinholeCamera,
    poses: Vec<RigidTransform>,
    rasterizer: Rasterizer,
    scratch: RasterScratch,
    image: RasterImage,
}

impl<'a> MapViews<'a> {
    /// Views by `camera` from `poses` (world from camera).
    #[must_use]
    pub fn new(map: &'a Gaussians, camera: PinholeCamera, poses: Vec<RigidTransform>) -> Self {
        let (scratch, image) = (RasterScratch::default(), RasterImage::default());
        Self { map, camera, poses, rasterizer: Rasterizer::new(SimdLevel::new()), scratch, image }
    }
}

impl ViewSource for MapViews<'_> {
    fn count(&self) -> usize {
        self.poses.len()
    }

    fn view(&mut self, index: usize) -> DepthView {
        let (camera, world_from_camera) = (self.camera, self.poses[index]);
        let view = RasterView { camera, world_from_camera, background: [0.0; 3] };
        self.rasterizer.forward(self.map, &view, &mut self.scratch, &mut self.image);
        let RasterImage { colour: [red, green, blue], depth, alpha, .. } = &self.image;
        // Light and depth are sums of shares that add up to alpha.
        let mean = |sum: f32, alpha: f32| if alpha > OPAQUE { sum / alpha } else { 0.0 };
        let light = red.iter().zip(green).zip(blue).zip(alpha);
        DepthView {
            camera,
            world_from_camera,
            depth: depth.iter().zip(alpha).map(|(depth, alpha)| mean(*depth, *alpha)).collect(),
            colour: light
                .map(|(((red, green), blue), alpha)| [red, green, blue].map(|light| mean(*light, *alpha)))
                .collect(),
        }
    }
}
