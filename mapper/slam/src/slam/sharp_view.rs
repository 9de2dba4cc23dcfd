//! Sharp views of the map for the tracker.

use mba_map::rendering::{Behind, ViewRenderer};
use mba_tracker::geometry::RigidTransform;

use super::growing_map::GrowingMap;
use super::messages::SharpView;

/// Share of the picture that the map has to show.
const SOLID: f64 = 0.8;

impl GrowingMap {
    /// What the map shows from a pose, unless it shows too little.
    pub(super) fn sharp_view(&self, world_from_camera: &RigidTransform) -> Option<SharpView> {
        let sensor = &self.sensor;
        let mut renderer = ViewRenderer::new(
            self.simd,
            &self.bundle.map,
            sensor.camera,
            &sensor.inverse_response,
            sensor.depth_scale,
        );
        let view = renderer.render(world_from_camera, Behind::Surroundings);
        (view.solid >= SOLID).then_some(SharpView {
            rgb: view.rgb,
            depth: view.depth,
            world_from_camera: *world_from_camera,
            start_from: None,
        })
    }
}
