//! Camera faults in the middle of a sequence: no panic, the right status, and no trace afterwards.

use mba_tests::handheld::{RenderedFrame, Shake, camera_of_width, pose_error, track_anew, tracker_config};
use mba_tests::plane_scene::PlaneScene;
use mba_tracker::{Doubt, FrameResult, FrameStatus};

use crate::scenes::{EXPOSURE, SMALL, elsewhere};

/// Replaces frame 6 of the small sequence and tracks it all.
fn with_fault(fault: impl Fn(&RenderedFrame) -> RenderedFrame) -> Vec<FrameResult> {
    let mut frames = SMALL[..12].to_vec();
    frames[6] = fault(&frames[6]);
    let results = track_anew(&tracker_config(camera_of_width(160)), &frames);
    for (result, frame) in results.iter().zip(&frames) {
        assert!(result.world_from_camera.mid().is_valid(), "frame {}", result.index);
        if result.index != 6 {
            let (metres, _) = pose_error(result, frame, &frames[0]);
            assert_ne!(result.status, FrameStatus::Lost, "frame {}", result.index);
            assert!(metres < 0.003, "frame {}: {metres} m after the fault", result.index);
        }
    }
    results
}

/// Lost, and the pose is that of the middle of the frame before.
fn assert_held(results: &[FrameResult]) {
    assert_eq!(results[6].status, FrameStatus::Lost);
    assert_eq!(results[6].world_from_camera.start, results[5].world_from_camera.mid());
    assert_eq!(results[6].world_from_camera.end, results[6].world_from_camera.start);
    assert!(!results[6].is_keyframe);
}

#[test]
fn a_black_frame_without_depth_holds_the_pose() {
    assert_held(&with_fault(|frame| frame.replaced(|_| 0, |_, _| 0)));
}

#[test]
fn a_saturated_frame_without_depth_holds_the_pose() {
    assert_held(&with_fault(|frame| frame.replaced(|_| 255, |_, _| 0)));
}

#[test]
fn a_view_of_another_place_holds_the_pose() {
    assert_held(&with_fault(|_| elsewhere(6)));
}

#[test]
fn depth_alone_carries_a_black_frame() {
    let results = with_fault(|frame| frame.replaced(|_| 0, |_, z| z));
    let (metres, _) = pose_error(&results[6], &SMALL[6], &SMALL[0]);
    assert!(results[6].status == FrameStatus::Lost || metres < 0.005, "{metres} m");
}

#[test]
fn the_image_alone_carries_a_frame_without_depth() {
    let results = with_fault(|frame| frame.replaced(|grey| grey, |_, _| 0));
    assert_ne!(results[6].status, FrameStatus::Lost);
    let (metres, _) = pose_error(&results[6], &SMALL[6], &SMALL[0]);
    assert!(metres < 0.005, "{metres} m");
    assert_eq!(results[6].depth_residual, 0.0);
}

#[test]
fn half_of_the_depth_is_enough() {
    let results = with_fault(|frame| frame.replaced(|grey| grey, |k, z| if k % 160 < 80 { 0 } else { z }));
    let (metres, _) = pose_error(&results[6], &SMALL[6], &SMALL[0]);
    assert_eq!(results[6].status, FrameStatus::Ok);
    assert!(metres < 0.002, "{metres} m");
}

#[test]
fn dropped_frames_are_bridged() {
    for gap in [2, 4] {
        let mut frames = SMALL[..6].to_vec();
        frames.extend_from_slice(&SMALL[6 + gap..12 + gap]);
        let results = track_anew(&tracker_config(camera_of_width(160)), &frames);
        for (result, frame) in results.iter().zip(&frames) {
            let (metres, _) = pose_error(result, frame, &frames[0]);
            assert!(result.status != FrameStatus::Lost && metres < 0.003, "gap {gap}: {metres} m");
        }
    }
}

/// Every tenth frame of a hand that turns and moves far: hardly any shares much with the one before.
fn thinned_out(seed: u64) -> Vec<RenderedFrame> {
    let hand = Shake { metres: 0.4, radians: 0.5, hertz: 1.1 };
    let (scene, camera) = (PlaneScene::corner(seed, 0.16), camera_of_width(160));
    let times = (0..8).map(|k| f64::from(k) / 3.0 + 0.1 * seed as f64);
    times.map(|t| RenderedFrame::new(&scene, &camera, t, EXPOSURE, hand.exposure(t, EXPOSURE))).collect()
}

#[test]
fn where_frames_share_little_hardly_a_wrong_one_is_ok() {
    let (mut ok, mut wrong) = (0, 0);
    for seed in 1..=12 {
        let frames = thinned_out(seed);
        let results = track_anew(&tracker_config(camera_of_width(160)), &frames);
        for (result, frame) in results.iter().zip(&frames).skip(1) {
            let (metres, _) = pose_error(result, frame, &frames[0]);
            println!("seed {seed}, frame {}: {:?}, {metres:.4} m", result.index, result.status);
            ok += usize::from(result.status == FrameStatus::Ok);
            wrong += usize::from(result.status == FrameStatus::Ok && metres > 0.05);
        }
    }
    println!("{wrong} of {ok} frames that are ok are wrong");
    assert!(ok > 3 && wrong <= 2, "{wrong} of {ok}");
}

#[test]
fn useless_frames_at_the_start_are_skipped() {
    let mut frames = SMALL[..8].to_vec();
    frames[0] = frames[0].replaced(|_| 0, |_, z| z);
    frames[1] = frames[1].replaced(|grey| grey, |_, _| 0);
    let results = track_anew(&tracker_config(camera_of_width(160)), &frames);
    assert_eq!((results[0].status, results[1].status), (FrameStatus::Lost, FrameStatus::Lost));
    assert!(results[2].is_keyframe && results[2].status == FrameStatus::Ok);
    for (result, frame) in results.iter().zip(&frames).skip(2) {
        let (metres, _) = pose_error(result, frame, &frames[2]);
        assert!(result.status == FrameStatus::Ok && metres < 0.002, "{metres} m");
    }
}

#[test]
fn a_doubled_first_frame_costs_nothing() {
    let mut frames = SMALL[..12].to_vec();
    frames[1] = RenderedFrame { timestamp: frames[1].timestamp, ..frames[0].clone() };
    let results = track_anew(&tracker_config(camera_of_width(160)), &frames);
    for (result, frame) in results.iter().zip(&frames) {
        let (metres, _) = pose_error(result, frame, &frames[0]);
        assert_eq!(result.status, FrameStatus::Ok, "frame {}", result.index);
        assert!(metres < 0.003, "frame {}: {metres} m", result.index);
    }
}

#[test]
fn a_first_frame_with_depth_of_no_sensor_is_not_the_start() {
    let mut frames = SMALL[..8].to_vec();
    frames[0] = frames[0].replaced(|grey| grey, |_, _| 1);
    let results = track_anew(&tracker_config(camera_of_width(160)), &frames);
    assert_eq!((results[0].status, results[0].doubt), (FrameStatus::Lost, Some(Doubt::NoStart)));
    for (result, frame) in results.iter().zip(&frames).skip(1) {
        let (metres, _) = pose_error(result, frame, &frames[1]);
        assert_eq!(result.status, FrameStatus::Ok, "frame {}", result.index);
        assert!(metres < 0.003, "frame {}: {metres} m", result.index);
    }
}

#[test]
fn after_six_covered_frames_the_second_good_one_is_right() {
    let mut frames = SMALL.clone();
    for frame in &mut frames[5..11] {
        *frame = frame.replaced(|_| 0, |_, _| 0);
    }
    let results = track_anew(&tracker_config(camera_of_width(160)), &frames);
    for (result, frame) in results.iter().zip(&frames) {
        let covered = (5..11).contains(&result.index);
        assert_eq!(result.doubt == Some(Doubt::Blind), covered, "frame {}", result.index);
        assert_eq!(result.status == FrameStatus::Lost, covered, "frame {}", result.index);
        let (metres, _) = pose_error(result, frame, &frames[0]);
        // The first one after the cover has nothing but its own picture to tell its motion.
        assert!(covered || result.index == 11 || metres < 0.005, "frame {}: {metres} m", result.index);
    }
}
