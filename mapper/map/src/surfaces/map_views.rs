//! A map as cameras see it.

use mba_raster::raster::RasterImage;
use mba_tracker::SimdLevel;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};

use super::{ColouredDepth, ViewSource};
use crate::map::{Scene, SceneRenderer};

/// Depth is used where the map hides at least this share of what is behind it.
const OPAQUE: f32 = 0.5;

/// Views of a map from given poses, rendered whenever they are asked for.
#[derive(Debug)]
pub struct MapViews<'a> {
    map: Scene<'a>,
    camera: PinholeCamera,
    poses: Vec<RigidTransform>,
    renderer: SceneRenderer,
}

impl<'a> MapViews<'a> {
    /// Views by `camera` from `poses` (world from camera), rendered with the instructions `simd`.
    #[must_use]
    pub fn new(
        simd: SimdLevel,
        map: impl Into<Scene<'a>>,
        camera: PinholeCamera,
        poses: Vec<RigidTransform>,
    ) -> Self {
        Self { map: map.into(), camera, poses, renderer: SceneRenderer::new(simd) }
    }
}

impl ViewSource for MapViews<'_> {
    fn count(&self) -> usize {
        self.poses.len()
    }

    fn view(&mut self, index: usize) -> ColouredDepth {
        let (camera, world_from_camera) = (self.camera, self.poses[index]);
        self.renderer.render(self.map, camera, &world_from_camera);
        let RasterImage { colour: [red, green, blue], depth, alpha, .. } = &self.renderer.image;
        // Light and depth are sums of shares that add up to alpha.
        let mean = |sum: f32, alpha: f32| if alpha > OPAQUE { sum / alpha } else { 0.0 };
        let light = red.iter().zip(green).zip(blue).zip(alpha);
        ColouredDepth {
            camera,
            world_from_camera,
            depth: depth.iter().zip(alpha).map(|(depth, alpha)| mean(*depth, *alpha)).collect(),
            colour: light
                .map(|(((red, green), blue), alpha)| [red, green, blue].map(|light| mean(*light, *alpha)))
                .collect(),
        }
    }
}
