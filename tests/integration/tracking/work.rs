//! Work per frame: counted, so that what is asserted does not depend on the machine.

use mba_tests::handheld::{RenderedFrame, Shake, camera_of_width, sequence, track_anew, tracker_config};
use mba_tests::plane_scene::PlaneScene;
use mba_tracker::{FrameResult, FrameStatus, TrackerConfig};

const SHAKE: Shake = Shake { metres: 0.1, radians: 0.12, hertz: 1.0 };

/// Units of work of the heaviest frame and of the median one.
fn heaviest_and_median(results: &[FrameResult]) -> (u64, u64) {
    let mut units: Vec<u64> = results.iter().map(|result| result.work.units()).collect();
    units.sort_unstable();
    (units[units.len() - 1], units[units.len() / 2])
}

fn track_within_bound(config: &TrackerConfig, frames: &[RenderedFrame]) -> Vec<FrameResult> {
    let bound = config.work_bound();
    let results = track_anew(config, frames);
    for result in &results {
        assert!(result.work.is_within(&bound), "frame {}: {:?}, bound {bound:?}", result.index, result.work);
        assert_eq!(result.iterations as u64, result.work.linearisations);
    }
    results
}

#[test]
fn no_frame_takes_four_times_the_median() {
    let camera = camera_of_width(320);
    let frames = sequence(&PlaneScene::corner(5, 0.1), &camera, &SHAKE, 20);
    let results = track_within_bound(&tracker_config(camera), &frames);
    // All that makes frames slow is there: a second frame, which is aligned twice, keyframes and their deblurring.
    assert!(results.iter().all(|result| result.status == FrameStatus::Ok));
    assert!(results[2..].iter().any(|result| result.is_keyframe && result.work.blur_taps > 0));
    let (heaviest, median) = heaviest_and_median(&results);
    println!("work: median {median}, max {heaviest}");
    assert!(heaviest <= 4 * median, "{heaviest} of {median}");
}

#[test]
fn the_frame_after_a_keyframe_does_part_of_its_deblurring() {
    let camera = camera_of_width(320);
    let frames = sequence(&PlaneScene::corner(5, 0.1), &camera, &SHAKE, 20);
    let config = tracker_config(camera);
    let results = track_within_bound(&config, &frames);
    // What a keyframe and the next frame do is whole: nine blurs with as many samples of every pixel each.
    let pixels = (camera.width * camera.height) as u64;
    let is_keyframe = |index: usize| results.get(index).is_some_and(|result| result.is_keyframe);
    let mut shared = 0;
    for k in 2..results.len() - 1 {
        if is_keyframe(k) && !is_keyframe(k - 1) && !is_keyframe(k + 1) {
            let [now, later] = [k, k + 1].map(|index| results[index].work.blur_taps / pixels);
            assert_eq!((now + later) % 9, 0, "frame {k}: {now} and {later} samples");
            shared += usize::from(later > 0);
        }
    }
    assert!(shared > 0, "no keyframe between others that are none was deblurred");
}

#[test]
fn lost_frames_stay_within_the_bound_too() {
    let camera = camera_of_width(160);
    let mut frames = sequence(&PlaneScene::corner(5, 0.1), &camera, &SHAKE, 12);
    for frame in &mut frames[7..9] {
        *frame = frame.replaced(|grey| grey.reverse_bits(), |_, _| 0);
    }
    let results = track_within_bound(&tracker_config(camera), &frames);
    assert!(results[7..9].iter().all(|result| result.status == FrameStatus::Lost));
}
