//! Every input that is refused, and that refusing leaves the tracker as it was.

use mba_tests::handheld::{camera_of_width, track_all, track_anew, tracker_config, workspace};
use mba_tracker::error::{ConfigError, FrameError};
use mba_tracker::geometry::RigidTransform;
use mba_tracker::image::{ColourView, DepthView, ExtentError, PixelFormat, PixelRectangle};
use mba_tracker::{ExpectedPath, Frame, ReferenceView, SimdLevel, Tracker, TrackerConfig};
use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector6};

use crate::scenes::SMALL;

fn error_name(change: impl FnOnce(&mut TrackerConfig)) -> (&'static str, String) {
    let mut config = tracker_config(camera_of_width(160));
    let mut memory = workspace(&config);
    change(&mut config);
    match Tracker::new(&config, SimdLevel::new(), &mut memory).map(|_| ()) {
        Err(error @ ConfigError::Setting { name, .. }) => (name, error.to_string()),
        other => panic!("{other:?} for {config:?}"),
    }
}

#[test]
fn settings_out_of_range_are_named() {
    for bad in [f64::NAN, f64::INFINITY, -140.0, 0.0, 1e6] {
        assert_eq!(error_name(|c| c.camera.fx = bad).0, "fx");
        assert_eq!(error_name(|c| c.camera.fy = bad).0, "fy");
    }
    for bad in [f64::NAN, f64::NEG_INFINITY, 1e6] {
        assert_eq!(error_name(|c| c.camera.cx = bad).0, "cx");
        assert_eq!(error_name(|c| c.camera.cy = bad).0, "cy");
    }
    for bad in [f32::NAN, f32::INFINITY, 0.0, -0.001, 1.0] {
        assert_eq!(error_name(|c| c.metres_per_unit = bad).0, "metres_per_unit");
    }
    for bad in [0, 31, 8193, usize::MAX] {
        assert_eq!(error_name(|c| c.camera.width = bad).0, "width");
        assert_eq!(error_name(|c| c.camera.height = bad).0, "height");
    }
    for bad in [0, 1, 5, 7, usize::MAX] {
        assert_eq!(error_name(|c| c.levels = bad).0, "levels");
    }
    assert_eq!(error_name(|c| c.surface_level = 3).0, "surface_level");
    let outside = PixelRectangle { left: 0, top: 0, right: 161, bottom: 120 };
    assert_eq!(error_name(|c| c.region = outside).0, "region");
    let beneath = PixelRectangle { left: 0, top: 0, right: 160, bottom: 121 };
    assert_eq!(error_name(|c| c.region = beneath).0, "region");
}

#[test]
fn messages_say_value_and_range() {
    let (_, message) = error_name(|c| c.camera.fx = -3.0);
    assert_eq!(message, "fx = -3: expected 1 to 100000 pixels");
    let error = FrameError::Size { expected: (160, 120), got: (320, 240) };
    assert_eq!(error.to_string(), "image is 320x240, the calibration says 160x120");
}

#[test]
fn buffers_that_are_too_short_are_refused() {
    let data = [0u8; 100];
    let colour = |w, h, stride, format| ColourView::new(&data, w, h, stride, format).map(|_| ());
    assert_eq!(colour(10, 10, 10, PixelFormat::Grey8), Ok(()));
    assert_eq!(colour(4, 9, 12, PixelFormat::Rgb8), Err(ExtentError { needed: 108, got: 100 }));
    assert_eq!(colour(4, 8, 12, PixelFormat::Rgb8), Ok(()));
    assert!(colour(5, 2, 14, PixelFormat::Rgb8).is_err(), "stride shorter than a row");
    assert!(colour(10, usize::MAX, 10, PixelFormat::Grey8).is_err(), "size overflows");
    assert!(colour(usize::MAX, 1, usize::MAX, PixelFormat::Rgb8).is_err(), "row overflows");
    let raw = [0u16; 100];
    assert_eq!(DepthView::new(&raw, 9, 10, 10).map(|_| ()), Ok(()));
    assert!(DepthView::new(&raw, 10, 11, 10).is_err());
    assert!(DepthView::new(&raw, 11, 2, 10).is_err());
}

/// Whether an error is the expected one.
type Expected = fn(&FrameError) -> bool;

/// Frames that are refused, with what is expected of the error.
fn refused(good: &Frame, previous: f64) -> Vec<(Frame<'static>, Expected)> {
    let grey: &[u8] = vec![128; 320 * 240].leak();
    let raw: &[u16] = vec![10_000; 320 * 240].leak();
    let colour = |w, h| ColourView::new(grey, w, h, w, PixelFormat::Grey8).expect("a view");
    let depth = |w, h| DepthView::new(raw, w, h, w).expect("a view");
    let frame = |timestamp, exposure, colour, depth| Frame {
        timestamp,
        exposure,
        depth_timestamp: timestamp,
        colour,
        depth,
        angular_velocity: None,
        gyro: None,
        expected_path: None,
    };
    let t = good.timestamp;
    let (c, d) = (colour(160, 120), depth(160, 120));
    let timestamp: Expected = |e| matches!(e, FrameError::Timestamp { .. });
    let exposure: Expected = |e| matches!(e, FrameError::Exposure { .. });
    let path: Expected = |e| matches!(e, FrameError::ExpectedPath);
    let impossible = |speed, sigma| ExpectedPath {
        velocity: Vector6::repeat(speed),
        acceleration: Vector6::zeros(),
        jerk: Vector6::zeros(),
        velocity_sigma: [sigma; 2],
        acceleration_sigma: [1.0; 2],
    };
    vec![
        (frame(t, 0.02, colour(320, 240), d), |e| {
            *e == FrameError::Size { expected: (160, 120), got: (320, 240) }
        }),
        (frame(t, 0.02, c, depth(160, 119)), |e| {
            *e == FrameError::Size { expected: (160, 120), got: (160, 119) }
        }),
        (frame(t, 0.02, colour(0, 0), d), |e| matches!(e, FrameError::Size { .. })),
        (frame(previous, 0.02, c, d), timestamp),
        (frame(t - 9.0, 0.02, c, d), timestamp),
        (frame(f64::NAN, 0.02, c, d), timestamp),
        (frame(f64::INFINITY, 0.02, c, d), timestamp),
        (frame(t, -0.02, c, d), exposure),
        (Frame { expected_path: Some(impossible(f64::NAN, 1.0)), ..frame(t, 0.02, c, d) }, path),
        (Frame { expected_path: Some(impossible(1e300, 1.0)), ..frame(t, 0.02, c, d) }, path),
        (Frame { expected_path: Some(impossible(0.1, -1.0)), ..frame(t, 0.02, c, d) }, path),
        (frame(t, f64::NAN, c, d), exposure),
        (frame(t, f64::INFINITY, c, d), exposure),
    ]
}

#[test]
fn refused_frames_leave_no_trace() {
    let config = tracker_config(camera_of_width(160));
    let clean = track_anew(&config, &SMALL[..6]);
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("memory");
    let mut disturbed = track_all(&mut tracker, &SMALL[..3]).expect("valid frames");
    for k in 3..6 {
        let frame = &SMALL[k];
        for (bad, expected) in refused(&frame.view(), SMALL[k - 1].timestamp) {
            let error = tracker.track(&bad).expect_err("a bad frame");
            assert!(expected(&error), "{error:?}");
        }
        for pose in bad_poses() {
            let view = frame.view();
            let view = ReferenceView { colour: view.colour, depth: view.depth, world_from_camera: pose };
            assert_eq!(tracker.set_reference(&view), Err(FrameError::Pose));
        }
        disturbed.push(tracker.track(&frame.view()).expect("a good frame"));
    }
    for (a, b) in clean.iter().zip(&disturbed) {
        assert_eq!((a.index, a.world_from_camera), (b.index, b.world_from_camera));
    }
}

fn bad_poses() -> [RigidTransform; 4] {
    let unit = |w, x| UnitQuaternion::new_unchecked(Quaternion::new(w, x, 0.0, 0.0));
    [
        RigidTransform::new(unit(1.0, 0.0), Vector3::new(0.0, f64::NAN, 0.0)),
        RigidTransform::new(unit(1.0, 0.0), Vector3::new(f64::INFINITY, 0.0, 0.0)),
        RigidTransform::new(unit(0.9, 0.0), Vector3::zeros()),
        RigidTransform::new(unit(f64::NAN, 0.0), Vector3::zeros()),
    ]
}
