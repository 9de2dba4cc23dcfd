//! Rows that are exposed one after the other, and depth that is measured later.

use mba_tests::handheld::{RenderedFrame, Shake, camera_of_width, pose_error, tracker_config, workspace};
use mba_tracker::geometry::PinholeCamera;
use mba_tracker::{Frame, FrameResult, FrameStatus, Readout, SimdLevel, Tracker};

use crate::scenes::ROOM;

const EXPOSURE: f64 = 0.006;
const READOUT: f64 = 0.024;
const DEPTH_DELAY: f64 = 0.01;

/// Up to 1.4 rad/s: the picture moves by four pixels while the rows are read out.
const SHAKE: Shake = Shake { metres: 0.05, radians: 0.16, hertz: 1.2 };

/// Rows of a band that is rendered at one time: a fortieth of the readout.
const BAND: usize = 3;

/// A frame at time `t` whose rows are exposed one after the other; its truth is that of the middle row.
pub(crate) fn rolling_frame(camera: &PinholeCamera, t: f64) -> RenderedFrame {
    let at = |t: f64| RenderedFrame::new(&ROOM, camera, t, EXPOSURE, SHAKE.exposure(t, EXPOSURE));
    let mut frame = at(t);
    for first in (0..camera.height).step_by(BAND) {
        let middle = (first as f64 + 0.5 * BAND as f64) / camera.height as f64 - 0.5;
        let band = at(t + middle * READOUT);
        let rows = first * camera.width..(first + BAND) * camera.width;
        frame.grey[rows.clone()].copy_from_slice(&band.grey[rows]);
    }
    frame.depth = at(t + DEPTH_DELAY).depth;
    frame
}

fn tracked(frames: &[RenderedFrame], readout: Readout) -> Vec<FrameResult> {
    let config = mba_tracker::TrackerConfig { readout, ..tracker_config(camera_of_width(160)) };
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("a valid configuration");
    let track = |frame: &RenderedFrame| {
        let view = Frame { depth_timestamp: frame.timestamp + DEPTH_DELAY, ..frame.view() };
        tracker.track(&view).expect("a valid frame")
    };
    frames.iter().map(track).collect()
}

/// Root mean square position error in metres.
fn error(results: &[FrameResult], frames: &[RenderedFrame]) -> f64 {
    let square = |(result, frame)| pose_error(result, frame, &frames[0]).0.powi(2);
    (results.iter().zip(frames).map(square).sum::<f64>() / frames.len() as f64).sqrt()
}

/// Where recordings begin, seconds. A single short one is at the mercy of its last frames.
const STARTS: [f64; 2] = [0.0, 0.4];

#[test]
fn rows_and_late_depth_are_modelled() {
    let camera = camera_of_width(160);
    let known = Readout { colour: READOUT, depth_apart: true, ..Readout::GLOBAL };
    let (mut modelled, mut ignored) = (0.0, 0.0);
    for start in STARTS {
        let frames: Vec<_> = (0..16).map(|k| rolling_frame(&camera, start + k as f64 / 30.0)).collect();
        let results = tracked(&frames, known);
        assert!(results.iter().all(|result| result.status == FrameStatus::Ok));
        modelled += error(&results, &frames);
        ignored += error(&tracked(&frames, Readout::GLOBAL), &frames);
        motion_follows_from_rows(&results, &frames);
    }
    assert!(modelled < 0.5 * ignored, "{modelled} m with, {ignored} m without the times of rows and depth");
}

/// The exposure's motion follows from the rows: its direction is certain and its length good.
fn motion_follows_from_rows(results: &[FrameResult], frames: &[RenderedFrame]) {
    for (result, frame) in results.iter().zip(frames).skip(2) {
        let (found, truth) = (result.world_from_camera.motion(), frame.truth.motion());
        let turn = |motion: &nalgebra::Vector6<f64>| motion.fixed_rows::<3>(3).into_owned();
        if turn(&truth).norm() > 0.003 {
            let cosine = turn(&found).dot(&turn(&truth)) / (turn(&found).norm() * turn(&truth).norm());
            assert!(cosine > 0.8, "frame {}: the direction's cosine is {cosine}", result.index);
        }
    }
}

#[test]
fn the_wrong_direction_of_the_rows_is_worse_than_none() {
    let camera = camera_of_width(160);
    let frames: Vec<_> = (0..12).map(|k| rolling_frame(&camera, k as f64 / 30.0)).collect();
    let of =
        |colour| error(&tracked(&frames, Readout { colour, depth_apart: true, ..Readout::GLOBAL }), &frames);
    let (right, none, wrong) = (of(READOUT), of(0.0), of(-READOUT));
    assert!(right < none && none < wrong, "right {right}, none {none}, wrong {wrong} m");
}
