//! The tracker's world moved, and the camera put somewhere else.

use mba_tests::handheld::{
    RenderedFrame, camera_of_width, pose_error, track_all, track_anew, tracker_config, workspace,
};
use mba_tracker::error::FrameError;
use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::{FrameResult, FrameStatus, ReferenceView, SimdLevel, Tracker};
use nalgebra::Vector3;

use crate::scenes::{ROOM, SMALL, elsewhere, still_frame};

fn new_world_from_world() -> RigidTransform {
    RigidTransform::new(so3::exp(&Vector3::new(0.3, -1.0, 0.2)), Vector3::new(4.0, -2.0, 7.0))
}

/// Tracks `frames`, the world being moved before frame `moved`.
fn track_in_two_worlds(frames: &[RenderedFrame], moved: usize) -> Vec<FrameResult> {
    let config = tracker_config(camera_of_width(160));
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("memory");
    let mut results = track_all(&mut tracker, &frames[..moved]).expect("valid frames");
    tracker.move_world(&new_world_from_world()).expect("a rigid transform");
    results.extend(track_all(&mut tracker, &frames[moved..]).expect("valid frames"));
    results
}

/// Asserts that results from `moved` on are those of a tracker that was left alone, in the new world.
fn assert_moved(frames: &[RenderedFrame], moved: usize) -> Vec<FrameResult> {
    let stayed = track_anew(&tracker_config(camera_of_width(160)), frames);
    let results = track_in_two_worlds(frames, moved);
    for (a, b) in stayed.iter().zip(&results).skip(moved) {
        assert_eq!((a.status, a.is_keyframe), (b.status, b.is_keyframe), "frame {}", a.index);
        let expected = a.world_from_camera.seen_from(&new_world_from_world());
        let ends = [(expected.start, b.world_from_camera.start), (expected.end, b.world_from_camera.end)];
        for (expected, got) in ends {
            // Positions are near 10 m now; all else is rounding, which iterations amplify a little.
            let difference = expected.tangent_to(&got).norm();
            assert!(difference < 1e-6, "frame {}: {difference}", a.index);
        }
    }
    results
}

#[test]
fn poses_continue_in_the_new_world() {
    let results = assert_moved(&SMALL, 8);
    assert!(results.iter().all(|result| result.status == FrameStatus::Ok));
    // The very first frame learns its motion from the second, in the world of the second.
    assert_moved(&SMALL[..6], 1);
}

#[test]
fn remembered_keyframes_move_too() {
    // Away from the first keyframe, blind, and back at it.
    let at = |radians: f64| {
        RigidTransform::new(so3::exp(&(Vector3::y() * -radians)), Vector3::new(-0.3 * radians, 0.0, 0.0))
    };
    let mut frames: Vec<_> = (0..12).map(|k| still_frame(&ROOM, k, at(0.09 * k as f64))).collect();
    let mut blind = still_frame(&ROOM, 0, at(0.0)).replaced(|_| 0, |_, _| 0);
    for k in 12..17 {
        blind.timestamp = k as f64 / 30.0;
        frames.push(blind.clone());
    }
    frames.extend((17..20).map(|k| still_frame(&ROOM, k, at(0.1))));
    let results = assert_moved(&frames, 14);
    assert_eq!(results[16].status, FrameStatus::Lost);
    assert_ne!(results[17].status, FrameStatus::Lost);
}

#[test]
fn a_lost_tracker_goes_on_where_it_is_told_to_be() {
    let config = tracker_config(camera_of_width(160));
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("memory");
    let origin = SMALL[0].truth.mid();
    // Another place altogether, so that nothing that is remembered helps.
    for k in 0..4 {
        tracker.track(&elsewhere(k).view()).expect("a valid frame");
    }
    assert_eq!(tracker.track(&SMALL[4].view()).expect("a valid frame").status, FrameStatus::Lost);
    // A few centimetres and degrees from the next frame.
    let beside =
        RigidTransform::new(so3::exp(&Vector3::new(0.02, -0.05, 0.03)), Vector3::new(0.05, -0.04, 0.03));
    let rendered = still_frame(&ROOM, 0, SMALL[5].truth.mid().compose(&beside));
    let view = rendered.view();
    let world_from_camera = origin.inverse().compose(&rendered.truth.mid());
    let reference = ReferenceView { colour: view.colour, depth: view.depth, world_from_camera };
    tracker.relocate(&reference, &reference.world_from_camera).expect("a valid view");
    for frame in &SMALL[5..12] {
        let result = tracker.track(&frame.view()).expect("a valid frame");
        let (metres, radians) = pose_error(&result, frame, &SMALL[0]);
        assert_eq!(result.status, FrameStatus::Ok, "frame {}", result.index);
        assert!(metres < 0.002 && radians < 0.002, "frame {}: {metres} m, {radians} rad", result.index);
    }
}

#[test]
fn a_world_that_is_no_rigid_transform_is_refused() {
    let config = tracker_config(camera_of_width(160));
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("memory");
    let nowhere =
        RigidTransform { translation: Vector3::new(f64::NAN, 0.0, 0.0), ..RigidTransform::identity() };
    assert_eq!(tracker.move_world(&nowhere), Err(FrameError::Pose));
}
