//! Sequences that several tests share; each is rendered once.

use std::sync::LazyLock;

use mba_tests::handheld::{RenderedFrame, Shake, camera_of_width, sequence};
use mba_tests::plane_scene::PlaneScene;

/// Seconds of every rendered exposure.
pub(crate) const EXPOSURE: f64 = 0.02;

/// A shaking hand: up to 0.5 m/s and 0.7 rad/s.
pub(crate) const HAND: Shake = Shake { metres: 0.05, radians: 0.08, hertz: 1.2 };

/// The room of the small sequences.
pub(crate) static ROOM: LazyLock<PlaneScene> = LazyLock::new(|| PlaneScene::corner(5, 0.16));

/// Twenty frames of 160x120.
pub(crate) static SMALL: LazyLock<Vec<RenderedFrame>> =
    LazyLock::new(|| sequence(&ROOM, &camera_of_width(160), &HAND, 20));

/// A view of another place with other texture, at the time of frame `k` of [`SMALL`].
pub(crate) fn elsewhere(k: usize) -> RenderedFrame {
    let mut pose = HAND.pose(k as f64 / 30.0);
    pose.rotation = mba_tracker::geometry::so3::exp(&nalgebra::Vector3::new(0.5, -1.1, 0.8)) * pose.rotation;
    still_frame(&PlaneScene::corner(77, 0.16), k, pose)
}

/// A sharp frame at the time of frame `k`: hardly any exposure time.
pub(crate) fn still_frame(
    scene: &PlaneScene,
    k: usize,
    world_from_camera: mba_tracker::geometry::RigidTransform,
) -> RenderedFrame {
    let truth = mba_tracker::trajectory::ExposureTrajectory::still(world_from_camera);
    RenderedFrame::new(scene, &camera_of_width(160), k as f64 / 30.0, 0.0, truth)
}
