//! A tracker whose memory was lost between two frames, and restored from bytes.

use mba_tests::handheld::{RenderedFrame, camera_of_width, tracker_config, workspace};
use mba_tracker::{
    Frame, FrameResult, FrameStatus, GyroReading, Readout, ReferenceMode, SessionError, SimdLevel, Tracker,
    TrackerConfig,
};
use nalgebra::Vector3;

use crate::recovery::away_and_back;
use crate::rolling::rolling_frame;
use crate::scenes::{SMALL, elsewhere};

/// A frame with what a gyroscope would say; that it is wrong does not matter here.
fn view(frame: &RenderedFrame) -> Frame<'_> {
    let rate = Vector3::new(0.1, -0.2, 0.05 + frame.timestamp);
    let gyro = GyroReading { angular_velocity: rate, angular_acceleration: -rate };
    let depth_timestamp = frame.timestamp + 0.01;
    Frame { angular_velocity: Some(rate), gyro: Some(gyro), depth_timestamp, ..frame.view() }
}

fn track(tracker: &mut Tracker<'_>, frames: &[RenderedFrame]) -> Vec<FrameResult> {
    frames.iter().map(|frame| tracker.track(&view(frame)).expect("a valid frame")).collect()
}

fn saved(tracker: &mut Tracker<'_>) -> Vec<u8> {
    let mut bytes = Vec::new();
    tracker.save(&mut |part| bytes.extend_from_slice(part));
    bytes
}

/// Asserts that a tracker that is exchanged for another one after every single frame gives the results of one that is not,
/// and of one that is never saved.
fn assert_goes_on(config: &TrackerConfig, frames: &[RenderedFrame]) -> Vec<FrameResult> {
    let mut memory = workspace(config);
    let mut tracker = Tracker::new(config, SimdLevel::new(), &mut memory).expect("memory");
    let (mut expected, mut sessions) = (Vec::new(), Vec::new());
    let mut session = saved(&mut tracker);
    for frame in frames {
        expected.push(tracker.track(&view(frame)).expect("a valid frame"));
        sessions.push(saved(&mut tracker));
    }
    for (k, frame) in frames.iter().enumerate() {
        // Memory that was full of something else, and a tracker that has seen other frames.
        let mut memory = vec![0xC9; config.workspace_len()];
        let mut tracker = Tracker::new(config, SimdLevel::new(), &mut memory).expect("memory");
        track(&mut tracker, &SMALL[..3]);
        tracker.restore(&session).expect("a session");
        let found = tracker.track(&view(frame)).expect("a valid frame");
        // Debug formatting of numbers tells all bits apart but those of NaN.
        assert_eq!(format!("{found:?}"), format!("{:?}", expected[k]), "frame {k}");
        session = saved(&mut tracker);
        let differs = session.iter().zip(&sessions[k]).position(|(a, b)| a != b);
        assert_eq!(differs, None, "of {} bytes after frame {k}", session.len());
    }
    assert!(session.len() < config.workspace_len());
    let mut memory = workspace(config);
    let mut unsaved = Tracker::new(config, SimdLevel::new(), &mut memory).expect("memory");
    assert_eq!(format!("{:?}", track(&mut unsaved, frames)), format!("{expected:?}"));
    expected
}

#[test]
fn a_restored_tracker_goes_on_bit_for_bit() {
    let mut frames = SMALL.to_vec();
    for (k, frame) in frames.iter_mut().enumerate().take(9).skip(7) {
        *frame = elsewhere(k);
    }
    let results = assert_goes_on(&tracker_config(camera_of_width(160)), &frames);
    let lost = results.iter().filter(|result| result.status == FrameStatus::Lost).count();
    assert!(lost == 2 && results.iter().any(|result| result.revision.is_some()), "{lost} lost");
}

#[test]
fn older_keyframes_are_restored_too() {
    let results = assert_goes_on(&tracker_config(camera_of_width(160)), &away_and_back());
    let found = &results[22];
    assert!(
        found.is_keyframe && found.status != FrameStatus::Lost,
        "nothing was found again: {:?}",
        found.status
    );
}

#[test]
fn a_sheared_keyframe_and_the_error_of_its_path_are_restored() {
    let camera = camera_of_width(160);
    let readout = Readout { colour: 0.024, depth: 0.01, depth_apart: true, ..Readout::GLOBAL };
    let frames: Vec<_> = (0..12).map(|k| rolling_frame(&camera, 0.4 + k as f64 / 30.0)).collect();
    for reference in [ReferenceMode::Deblurred, ReferenceMode::Raw] {
        let config = TrackerConfig { readout, reference, ..tracker_config(camera) };
        assert_goes_on(&config, &frames);
    }
}

/// Asserts that a tracker that has seen other frames and was reset does the same as a new one.
fn assert_starts_anew(
    config: &TrackerConfig,
    before: &[RenderedFrame],
    frames: &[RenderedFrame],
    gyro: bool,
) {
    let mut memory = [workspace(config), vec![0xC9; config.workspace_len()]];
    let [fresh, used] = &mut memory;
    let mut fresh = tracker_anew(config, fresh);
    let mut used = tracker_anew(config, used);
    track(&mut used, before);
    used.reset();
    assert!(saved(&mut used) == saved(&mut fresh), "something outlives a reset");
    let seen = |frame| if gyro { view(frame) } else { Frame { gyro: None, ..view(frame) } };
    for (k, frame) in frames.iter().enumerate() {
        let [expected, found] = [&mut fresh, &mut used].map(|tracker| tracker.track(&seen(frame)));
        assert_eq!(format!("{found:?}"), format!("{expected:?}"), "frame {k}");
    }
    assert!(saved(&mut used) == saved(&mut fresh), "results are the same, but not what is remembered");
}

#[test]
fn a_reset_tracker_is_a_new_one_bit_for_bit() {
    let camera = camera_of_width(160);
    let rolling = Readout { colour: 0.024, depth: 0.01, depth_apart: true, ..Readout::GLOBAL };
    let rows: Vec<_> = (0..10).map(|k| rolling_frame(&camera, 0.4 + k as f64 / 30.0)).collect();
    for (readout, frames) in [(Readout::GLOBAL, &SMALL[..10]), (rolling, &rows[..])] {
        for gyro in [false, true] {
            let config = TrackerConfig { readout, ..tracker_config(camera) };
            assert_starts_anew(&config, &away_and_back(), frames, gyro);
            // The frame after which it is reset is the first, and one that is lost.
            assert_starts_anew(&config, &SMALL[..1], frames, gyro);
            assert_starts_anew(&config, &[SMALL[0].clone(), SMALL[1].clone(), elsewhere(2)], frames, gyro);
        }
    }
}

#[test]
fn what_is_no_session_is_refused_and_the_tracker_begins_anew() {
    let config = tracker_config(camera_of_width(160));
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("memory");
    track(&mut tracker, &SMALL[..6]);
    let session = saved(&mut tracker);
    let with = |changes: &[(usize, u8)]| {
        let mut changed = session.clone();
        changes.iter().for_each(|(at, byte)| changed[*at] = *byte);
        changed
    };
    // The layout is followed by six counts of keypoints, and these by the pixels of the finest level.
    let (pixels, end) = (8 + 6 * 8, session.len());
    let refused = [
        (Vec::new(), SessionError::Layout),
        (with(&[(0, !session[0])]), SessionError::Layout),
        (session[..end / 2].to_vec(), SessionError::Length),
        (session[..end - 1].to_vec(), SessionError::Length),
        ([&session[..], &[0]].concat(), SessionError::Length),
        // More keypoints than there are, and an infinite pixel.
        (with(&[(8 + 3, 1)]), SessionError::Length),
        (with(&[(pixels + 2, 0x80), (pixels + 3, 0x7F)]), SessionError::Unsound),
        // The number of frames.
        (with(&[(end - 1, 0xFF)]), SessionError::Unsound),
    ];
    let fresh = format!("{:?}", track(&mut tracker_anew(&config, &mut workspace(&config)), &SMALL[..6]));
    for (k, (bytes, expected)) in refused.iter().enumerate() {
        let found = tracker.restore(bytes);
        assert_eq!(found, Err(*expected), "{k}");
        assert_eq!(format!("{:?}", track(&mut tracker, &SMALL[..6])), fresh, "after {k}");
    }
    tracker.restore(&session).expect("the session itself");
}

fn tracker_anew<'m>(config: &TrackerConfig, memory: &'m mut [u8]) -> Tracker<'m> {
    Tracker::new(config, SimdLevel::new(), memory).expect("memory")
}
