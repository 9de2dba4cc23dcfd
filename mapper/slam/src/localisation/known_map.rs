//! A map that stays as it is, and the places to recognise in it.

use mba_adjust::places::PlaceDescriptor;
use mba_io::dataset::{Dataset, RgbdFrame};
use mba_map::map::Scene;
use mba_map::rendering::{Behind, ViewRenderer};
use mba_tracker::TrackerConfig;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};

use super::places::Places;
use crate::run::Run;
use crate::slam::{Relocaliser, SharpView};

/// Share of the picture that the map has to show for a frame to be aligned with it.
const SOLID: f64 = 0.8;

/// How far a pose that was found from a place may differ from the one found from there, metres and radians: as far as a
/// frame that was aligned well is off when the view is from far away.
const SAME_POSE: (f64, f64) = (0.05, 0.035);

/// Share of a view that has to agree with a frame of which nothing else is known.
const MOST: f32 = 0.5;

/// A map as the camera of a recording sees it.
pub struct KnownMap<'a> {
    renderer: ViewRenderer<'a>,
    camera: PinholeCamera,
    relocaliser: Relocaliser,
    places: Places,
}

impl<'a> KnownMap<'a> {
    /// The map `scene` of `run` for the recording `dataset`, which is tracked with `config`.
    #[must_use]
    pub fn new(scene: Scene<'a>, run: &Run, dataset: &Dataset, config: &TrackerConfig) -> Self {
        let calibration = dataset.calibration();
        let (camera, response) = (calibration.camera, calibration.response.inverse());
        let simd = dataset.simd();
        let renderer = |camera| ViewRenderer::new(simd, scene, camera, &response, calibration.depth_scale);
        let places = Places::of(run, camera, calibration.depth_scale, renderer);
        let relocaliser = Relocaliser::new(config, simd);
        Self { renderer: renderer(camera), camera, relocaliser, places }
    }

    /// Number of views that a place is recognised by.
    #[must_use]
    pub fn places(&self) -> usize {
        self.places.len()
    }

    /// What the map shows from a pose, unless it shows too little to align a frame with.
    pub(super) fn view(&mut self, world_from_camera: &RigidTransform) -> Option<SharpView> {
        let view = self.renderer.render(world_from_camera, Behind::Surroundings);
        (view.solid >= SOLID).then_some(SharpView {
            rgb: view.rgb,
            depth: view.depth,
            world_from_camera: *world_from_camera,
            start_from: None,
        })
    }

    /// Where a frame was seen from, of which nothing is known: a view of the map from there, to start from. Of several places
    /// that it looks like, the one that most of it agrees with.
    pub(super) fn find(&mut self, image: &RgbdFrame) -> Option<SharpView> {
        let descriptor = PlaceDescriptor::new(&image.rgb, &self.camera).ok()?;
        let guesses = self.places.guesses(&descriptor);
        let found = guesses.iter().filter_map(|guess| self.find_twice(image, guess));
        let best = found.max_by(|a, b| a.1.total_cmp(&b.1));
        best.filter(|(_, inliers)| *inliers > MOST).map(|(view, _)| view)
    }

    /// Where a frame was seen from that was taken near a pose, as [`Self::find`].
    pub(super) fn find_near(
        &mut self,
        image: &RgbdFrame,
        world_from_camera: &RigidTransform,
    ) -> Option<SharpView> {
        self.align(image, world_from_camera).map(|(view, _)| view)
    }

    /// The same, found again from where it was found first: a place that only looks alike seldom is. With the share of the
    /// view that agrees.
    fn find_twice(&mut self, image: &RgbdFrame, guess: &RigidTransform) -> Option<(SharpView, f32)> {
        let start = self.align(image, guess)?.0.start_from?;
        let again = self.align(image, &start)?;
        let difference = start.inverse().compose(&again.0.start_from?);
        let (metres, radians) = SAME_POSE;
        let agrees = difference.translation.norm() < metres && difference.rotation.angle() < radians;
        agrees.then_some(again)
    }

    /// Aligns a frame with what the map shows from a pose; the view to start from, and the share of it that agrees.
    fn align(&mut self, image: &RgbdFrame, world_from_camera: &RigidTransform) -> Option<(SharpView, f32)> {
        let view = self.view(world_from_camera)?;
        let found = self.relocaliser.align_to(image, &view, world_from_camera)?;
        Some((SharpView { start_from: Some(found.world_from_camera), ..view }, found.inliers))
    }
}
