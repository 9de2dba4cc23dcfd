//! Less memory and less work, and what they cost.

use mba_tests::handheld::{Shake, camera_of_width, sequence, track_anew, tracker_config, trajectory_error};
use mba_tests::plane_scene::PlaneScene;
use mba_tracker::photometric::InverseResponse;
use mba_tracker::{Effort, FrameStatus, ReferenceMode, TrackerConfig};

const SHAKE: Shake = Shake { metres: 0.1, radians: 0.08, hertz: 1.0 };

fn compact(width: usize) -> TrackerConfig {
    let usual = tracker_config(camera_of_width(width));
    TrackerConfig::compact(usual.camera, usual.metres_per_unit, InverseResponse::linear())
}

#[test]
fn compact_trackers_fit_where_they_are_meant_for() {
    assert!(compact(160).workspace_len() <= 448 << 10, "64 KB of 512 are left for stack and program");
    assert!(compact(320).workspace_len() <= 2 << 20);
}

#[test]
fn raw_keyframes_take_no_memory_for_deblurring() {
    let mut config = tracker_config(camera_of_width(160));
    let with_deblurring = config.workspace_len();
    config.reference = ReferenceMode::Raw;
    // Three images of 4 bytes per pixel and the flow of 8x4 blocks.
    assert_eq!(with_deblurring - config.workspace_len(), 3 * 4 * 160 * 120 + 8 * 20 * 30);
}

#[test]
fn lower_effort_takes_fewer_iterations_and_still_tracks() {
    let camera = camera_of_width(320);
    let frames = sequence(&PlaneScene::corner(5, 0.1), &camera, &SHAKE, 20);
    let run = |config: TrackerConfig| {
        let results = track_anew(&config, &frames);
        assert!(results.iter().all(|result| result.status != FrameStatus::Lost));
        let iterations: usize = results.iter().map(|result| result.iterations).sum();
        let views: usize = results.iter().map(|result| result.virtual_views).max().unwrap_or(0);
        (iterations, views, 1e3 * trajectory_error(&results, &frames))
    };
    let efforts = [Effort::Full, Effort::Medium, Effort::Low];
    let [full, medium, low] = efforts.map(|effort| run(tracker_config(camera).with_effort(effort)));
    let small = run(compact(320));
    println!("full {full:?}, medium {medium:?}, low {low:?}, compact {small:?}: iterations, views, mm");
    assert!(low.0 < medium.0 && medium.0 < full.0);
    assert!(medium.1 <= 16 && low.1 <= 8);
    assert!([full, medium, low, small].iter().all(|run| run.2 < 10.0));
}
