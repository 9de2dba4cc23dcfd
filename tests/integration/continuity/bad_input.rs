//! Degenerate sequences are passed through, impossible ones are named.

use mba_mapper::continuity::{
    ContinuityError, ContinuityFrame, ContinuitySettings, FrameVerdict, MotionLimits, PoseNoise, repair,
};
use mba_tracker::geometry::RigidTransform;
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{Quaternion, UnitQuaternion};

use crate::shaken::Shaken;

fn error_of(change: impl FnOnce(&mut Vec<ContinuityFrame>)) -> ContinuityError {
    let mut frames = Shaken::new(1, 4.0).frames;
    change(&mut frames);
    repair(&frames, &ContinuitySettings::default()).expect_err("invalid frames")
}

#[test]
fn too_few_frames_are_left_alone() {
    let frames = Shaken::new(1, 4.0).frames;
    for count in 0..5 {
        let result = repair(&frames[..count], &ContinuitySettings::default()).expect("valid frames");
        let given: Vec<_> = frames[..count].iter().map(|frame| frame.world_from_camera).collect();
        assert_eq!(result.exposures, given);
        assert_eq!(result.verdicts, vec![FrameVerdict::Kept; count]);
    }
}

#[test]
fn a_camera_that_stands_still_or_has_an_instant_shutter_is_left_alone() {
    let mut frames = Shaken::new(1, 4.0).frames;
    for frame in &mut frames {
        frame.world_from_camera = ExposureTrajectory::still(RigidTransform::identity());
    }
    let settings = ContinuitySettings::default();
    let verdicts = repair(&frames, &settings).expect("valid frames").verdicts;
    assert!(verdicts.iter().all(|&verdict| verdict == FrameVerdict::Kept));
    let mut frames = Shaken::new(1, 4.0).frames;
    for frame in &mut frames {
        frame.exposure_seconds = 0.0;
        frame.world_from_camera = ExposureTrajectory::still(frame.world_from_camera.mid());
    }
    let verdicts = repair(&frames, &settings).expect("valid frames").verdicts;
    assert!(verdicts.iter().all(|&verdict| verdict == FrameVerdict::Kept));
}

#[test]
fn frames_that_are_all_lost_stay_unresolved() {
    let mut frames = Shaken::new(1, 4.0).frames;
    frames.iter_mut().for_each(|frame| frame.noise = None);
    let result = repair(&frames, &ContinuitySettings::default()).expect("valid frames");
    assert!(result.verdicts.iter().all(|&verdict| verdict == FrameVerdict::Unresolved));
}

#[test]
fn times_have_to_increase() {
    let error = error_of(|frames| frames[7].timestamp = frames[6].timestamp);
    assert!(matches!(error, ContinuityError::Timestamp { frame: 7, .. }), "{error}");
    let error = error_of(|frames| frames[3].timestamp = f64::NAN);
    assert!(matches!(error, ContinuityError::Timestamp { frame: 3, .. }), "{error}");
    let error = error_of(|frames| frames[4].exposure_seconds = -0.01);
    assert_eq!(error.to_string(), "frame 4: exposure of -0.01 s");
}

#[test]
fn poses_and_noise_have_to_be_finite() {
    let error = error_of(|frames| frames[5].world_from_camera.end.translation.y = f64::INFINITY);
    assert_eq!(error, ContinuityError::Pose { frame: 5, end: "closing" });
    let long = UnitQuaternion::new_unchecked(Quaternion::new(2.0, 0.0, 0.0, 0.0));
    let error = error_of(|frames| frames[8].world_from_camera.start.rotation = long);
    assert_eq!(error, ContinuityError::Pose { frame: 8, end: "opening" });
    let error = error_of(|frames| frames[2].noise = Some(PoseNoise { translation: 0.0, rotation: 1e-3 }));
    assert_eq!(error, ContinuityError::Noise { frame: 2, translation: 0.0, rotation: 1e-3 });
}

#[test]
fn settings_out_of_range_are_named() {
    let good = ContinuitySettings::default();
    let limits = MotionLimits { acceleration: 0.0, jerk: 1.0 };
    for (settings, expected) in [
        (ContinuitySettings { rotation: limits, ..good }, "rotation.acceleration"),
        (ContinuitySettings { huber: f64::NAN, ..good }, "huber"),
        (ContinuitySettings { control_points_per_frame: 9.0, ..good }, "control_points_per_frame"),
        (ContinuitySettings { rounds: 0, ..good }, "rounds"),
    ] {
        match repair(&[], &settings) {
            Err(ContinuityError::Setting { name, .. }) => assert_eq!(name, expected),
            other => panic!("{other:?}"),
        }
    }
}
