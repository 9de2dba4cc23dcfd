//! Accuracy and repeatability on whole sequences.

use mba_tests::handheld::{
    RenderedFrame, Shake, camera_of_width, exposure_errors, pose_error, sequence, track_all, track_anew,
    tracker_config, trajectory_error, workspace,
};
use mba_tests::plane_scene::PlaneScene;
use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::simd::levels_up_to;
use mba_tracker::trajectory::ExposureTrajectory;
use mba_tracker::{FrameResult, FrameStatus, ReferenceMode, SimdLevel, Tracker};
use nalgebra::Vector3;

use crate::scenes::{EXPOSURE, HAND, ROOM, SMALL};

fn assert_all_ok(results: &[FrameResult]) {
    for result in results {
        assert_eq!(result.status, FrameStatus::Ok, "frame {}", result.index);
    }
}

/// Displacement in pixels between opening and closing at the centre of the image, 3 m away.
fn true_blur(frame: &RenderedFrame) -> f64 {
    let motion = frame.truth.motion();
    let focal = camera_of_width(frame.size.0).fx;
    let (turn, shift) = (motion.fixed_rows::<2>(3), motion.fixed_rows::<2>(0));
    focal * ((turn[1] + shift[0] / 3.0).powi(2) + (turn[0] - shift[1] / 3.0).powi(2)).sqrt()
}

#[test]
fn small_sequence_is_followed_with_and_without_depth() {
    let mut config = tracker_config(camera_of_width(160));
    for (depth_term, bound) in [(true, 0.001), (false, 0.012)] {
        config.align.depth_term = depth_term;
        let results = track_anew(&config, &SMALL);
        assert_all_ok(&results);
        let error = trajectory_error(&results, &SMALL);
        println!("160x120, depth term {depth_term}: {error:.6} m");
        assert!(error < bound, "depth term {depth_term}: {error} m");
    }
}

#[test]
fn blurred_sequence_yields_poses_at_both_ends_of_the_exposure() {
    let shake = Shake { metres: 0.05, radians: 0.1, hertz: 1.6 };
    let frames = sequence(&PlaneScene::corner(9, 0.1), &camera_of_width(320), &shake, 12);
    let results = track_anew(&tracker_config(camera_of_width(320)), &frames);
    assert_all_ok(&results);
    let error = trajectory_error(&results, &frames);
    println!("320x240: {error:.6} m");
    assert!(error < 0.001, "{error} m");
    let mut blurred = 0;
    for (result, frame) in results.iter().zip(&frames).skip(2) {
        if true_blur(frame) < 2.4 {
            continue;
        }
        blurred += 1;
        let truth = frame.truth.seen_from(&frames[0].truth.mid().inverse());
        let (mid, motion) = exposure_errors(&camera_of_width(320), &result.world_from_camera, &truth);
        println!("frame {}: {:.1} px, errors {mid:.3} and {motion:.3} px", result.index, true_blur(frame));
        // With time running backwards the motion would be wrong by twice the blur.
        let bound = 0.6 + 0.15 * true_blur(frame);
        assert!(mid < 0.1 && motion < bound, "frame {}: mid {mid} px, motion {motion} px", result.index);
    }
    assert!(blurred >= 6, "only {blurred} frames are blurred");
}

#[test]
fn results_are_the_same_bit_for_bit() {
    let config = tracker_config(camera_of_width(160));
    let first = track_anew(&config, &SMALL);
    // Memory that was used before, at another address.
    let mut memory = vec![0xa5; config.workspace_len() + 13];
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory[13..]).expect("memory");
    let second = track_all(&mut tracker, &SMALL).expect("valid frames");
    tracker.reset();
    let third = track_all(&mut tracker, &SMALL).expect("valid frames");
    for (a, (b, c)) in first.iter().zip(second.iter().zip(&third)) {
        for other in [b, c] {
            assert_eq!(a.world_from_camera, other.world_from_camera, "frame {}", a.index);
            assert_eq!(a.information, other.information, "frame {}", a.index);
            assert_eq!((a.iterations, a.is_keyframe), (other.iterations, other.is_keyframe));
        }
    }
}

#[test]
fn every_instruction_set_follows_the_same_path() {
    let config = tracker_config(camera_of_width(160));
    let frames = &SMALL[..8];
    for level in levels_up_to(SimdLevel::new()) {
        let mut memory = workspace(&config);
        let mut tracker = Tracker::new(&config, level, &mut memory).expect("memory");
        let results = track_all(&mut tracker, frames).expect("valid frames");
        assert_all_ok(&results);
        let error = trajectory_error(&results, frames);
        assert!(error < 0.001, "{}: {error} m", mba_tracker::simd::level_name(level));
    }
}

#[test]
fn raw_and_sharp_frames_are_followed_too() {
    let mut config = tracker_config(camera_of_width(160));
    config.reference = ReferenceMode::Raw;
    let results = track_anew(&config, &SMALL);
    assert_all_ok(&results);
    assert!(trajectory_error(&results, &SMALL) < 0.002);
    config.align.blur = false;
    let sharp: Vec<_> = (0..6)
        .map(|k| {
            let t = f64::from(k) / 30.0;
            let truth = ExposureTrajectory::still(HAND.pose(t));
            RenderedFrame::new(&ROOM, &camera_of_width(160), t, EXPOSURE, truth)
        })
        .collect();
    let results = track_anew(&config, &sharp);
    assert_all_ok(&results);
    let error = trajectory_error(&results, &sharp);
    assert!(error < 0.001, "{error} m");
    assert!(results.iter().skip(1).all(|result| result.virtual_views == 1));
}

#[test]
fn first_frame_learns_its_motion_from_the_second() {
    let results = track_anew(&tracker_config(camera_of_width(160)), &SMALL[..3]);
    let revision = results[1].revision.expect("the second frame revises the first");
    assert_eq!(revision.index, 0);
    assert!(results[2].revision.is_none());
    let truth = SMALL[0].truth.seen_from(&SMALL[0].truth.mid().inverse());
    let error = revision.world_from_camera.motion() - truth.motion();
    let pixels = camera_of_width(160).fx * error.fixed_rows::<3>(3).norm();
    assert!(pixels < 0.5, "motion of the first frame is wrong by {pixels} px");
}

/// A camera that stands still and then turns at `rate` rad/s about the vertical.
fn sudden_turn(rate: f64) -> Vec<RenderedFrame> {
    let pose = |t: f64| {
        let angle = rate * (t - 4.0 / 30.0).max(0.0);
        RigidTransform::new(so3::exp(&(Vector3::y() * angle)), Vector3::zeros())
    };
    (0..7)
        .map(|k| {
            let t = f64::from(k) / 30.0;
            let truth = ExposureTrajectory { start: pose(t - 0.005), end: pose(t + 0.005) };
            RenderedFrame::new(&ROOM, &camera_of_width(160), t, 0.01, truth)
        })
        .collect()
}

#[test]
fn gyroscope_keeps_a_sudden_turn() {
    const RATE: f64 = 9.0;
    let frames = sudden_turn(RATE);
    let config = tracker_config(camera_of_width(160));
    let without = track_anew(&config, &frames);
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("memory");
    for (k, frame) in frames.iter().enumerate() {
        let rate = if k > 4 { RATE } else { 0.0 };
        let mut view = frame.view();
        view.angular_velocity = Some(Vector3::y() * rate);
        let result = tracker.track(&view).expect("a valid frame");
        let (metres, radians) = pose_error(&result, frame, &frames[0]);
        let (metres_without, _) = pose_error(&without[k], frame, &frames[0]);
        println!("{:?} {metres:.4} m, without {:?} {metres_without:.4} m", result.status, without[k].status);
        // The first frame of the turn is 40 px away from where a camera at rest would be.
        assert_ne!(result.status, FrameStatus::Lost, "frame {k}");
        assert!(metres < 0.005 && radians < 0.002, "frame {k}: {metres} m, {radians} rad");
        // A lost frame holds its pose, which a camera that only turns does not leave.
        let is_lost = without[k].status == FrameStatus::Lost;
        assert!(
            is_lost || metres <= metres_without + 1e-4,
            "frame {k}: {metres} m, without {metres_without} m"
        );
    }
}
