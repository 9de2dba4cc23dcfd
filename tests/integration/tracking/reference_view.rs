//! Sharp views from outside as the reference.

use mba_tests::handheld::{RenderedFrame, camera_of_width, track_all, tracker_config, workspace};
use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::{FrameStatus, ReferenceView, SimdLevel, Tracker};
use nalgebra::Vector3;

use crate::scenes::{HAND, ROOM, SMALL, still_frame};

/// The tracker's world is shifted and turned against the scene's.
fn world_from_scene() -> RigidTransform {
    RigidTransform::new(so3::exp(&Vector3::new(0.3, -1.0, 0.2)), Vector3::new(4.0, -2.0, 7.0))
}

fn reference_of(rendered: &RenderedFrame) -> ReferenceView<'_> {
    let view = rendered.view();
    let world_from_camera = world_from_scene().compose(&rendered.truth.mid());
    ReferenceView { colour: view.colour, depth: view.depth, world_from_camera }
}

#[test]
fn tracking_starts_in_the_world_of_a_reference() {
    let config = tracker_config(camera_of_width(160));
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("memory");
    let rendered = still_frame(&ROOM, 0, HAND.pose(0.05));
    tracker.set_reference(&reference_of(&rendered)).expect("a valid view");
    let results = track_all(&mut tracker, &SMALL[..6]).expect("valid frames");
    for (result, frame) in results.iter().zip(&SMALL[..]) {
        let truth = world_from_scene().compose(&frame.truth.mid());
        let error = truth.tangent_to(&result.world_from_camera.mid());
        assert_ne!(result.status, FrameStatus::Lost, "frame {}", result.index);
        assert!(error.fixed_rows::<3>(0).norm() < 0.002, "frame {}: {error:?}", result.index);
    }
}

#[test]
fn a_reference_in_the_middle_replaces_the_keyframe() {
    let config = tracker_config(camera_of_width(160));
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("memory");
    track_all(&mut tracker, &SMALL[..5]).expect("valid frames");
    let origin = SMALL[0].truth.mid().inverse();
    let rendered = still_frame(&ROOM, 0, SMALL[5].truth.mid());
    let view = rendered.view();
    let world_from_camera = origin.compose(&rendered.truth.mid());
    let reference = ReferenceView { colour: view.colour, depth: view.depth, world_from_camera };
    tracker.set_reference(&reference).expect("a valid view");
    for frame in &SMALL[5..10] {
        let result = tracker.track(&frame.view()).expect("a valid frame");
        let error = origin.compose(&frame.truth.mid()).tangent_to(&result.world_from_camera.mid());
        assert_eq!(result.status, FrameStatus::Ok);
        assert_eq!(result.reference_index, 4);
        assert!(error.fixed_rows::<3>(0).norm() < 0.001, "{error:?}");
    }
}
