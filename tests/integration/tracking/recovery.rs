//! Lost and found again.

use mba_tests::handheld::{RenderedFrame, camera_of_width, pose_error, track_anew, tracker_config};
use mba_tracker::FrameStatus;
use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::Vector3;

use crate::scenes::{ROOM, SMALL, elsewhere, still_frame};

#[test]
fn several_lost_frames_hold_the_pose_and_the_next_good_one_is_found() {
    let mut frames = SMALL.to_vec();
    for (k, frame) in frames.iter_mut().enumerate().take(12).skip(7) {
        *frame = elsewhere(k);
    }
    let results = track_anew(&tracker_config(camera_of_width(160)), &frames);
    let held = results[6].world_from_camera.mid();
    for result in &results[7..12] {
        assert_eq!(result.status, FrameStatus::Lost, "frame {}", result.index);
        assert_eq!(result.world_from_camera.mid(), held);
    }
    // The first frame may be found only roughly: six frames of motion have passed unseen.
    for (result, frame) in results.iter().zip(&frames).skip(13) {
        let (metres, _) = pose_error(result, frame, &frames[0]);
        assert_eq!(result.status, FrameStatus::Ok, "frame {}", result.index);
        assert!(metres < 0.003, "frame {}: {metres} m", result.index);
    }
}

/// Frames of the pan away in [`away_and_back`].
const AWAY: usize = 12;

/// A pan of nearly the field of view to the left wall, which holds the camera sideways; ten blind frames; the place where
/// the pan began.
pub(crate) fn away_and_back() -> Vec<RenderedFrame> {
    let at = |radians: f64| {
        RigidTransform::new(so3::exp(&(Vector3::y() * -radians)), Vector3::new(-0.3 * radians, 0.0, 0.0))
    };
    let away = AWAY;
    let mut frames: Vec<_> = (0..away).map(|k| still_frame(&ROOM, k, at(0.09 * k as f64))).collect();
    let blind = still_frame(&ROOM, 0, at(0.0)).replaced(|_| 0, |_, _| 0);
    for k in away..away + 10 {
        let mut frame = blind.clone();
        frame.timestamp = k as f64 / 30.0;
        frames.push(frame);
    }
    for k in away + 10..away + 14 {
        frames.push(still_frame(&ROOM, k, at(0.1 - 0.02 * (k - away - 10) as f64)));
    }
    frames
}

#[test]
fn an_older_keyframe_is_found_after_moving_back_unseen() {
    let (away, frames) = (AWAY, away_and_back());
    let results = track_anew(&tracker_config(camera_of_width(160)), &frames);
    assert!(results[1..away].iter().any(|result| result.is_keyframe), "no keyframe was replaced");
    assert!(results[away..away + 10].iter().all(|result| result.status == FrameStatus::Lost));
    // The last keyframe is out of sight, so the frame that was found again starts a new one.
    assert!(results[away + 10].is_keyframe, "{:?}", results[away + 10].status);
    for (result, frame) in results.iter().zip(&frames).skip(away + 10) {
        let (metres, radians) = pose_error(result, frame, &frames[0]);
        assert_ne!(result.status, FrameStatus::Lost, "frame {}", result.index);
        assert!(metres < 0.01 && radians < 0.005, "frame {}: {metres} m, {radians} rad", result.index);
    }
}
