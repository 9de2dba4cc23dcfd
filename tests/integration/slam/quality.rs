//! What comes of a short blurred sequence.

use mba_mapper::gaussians::read_ply;
use mba_mapper::map::MAP_FILE;
use mba_mapper::run::{FrameStatus, Run};
use mba_mapper::slam::SlamSettings;
use mba_mapper::synth::SynthConfig;
use mba_tests::blurred_sequence::{BlurredSequence, assert_same_map, names};

const FRAMES: usize = 10;

fn sequence(width: usize, height: usize, frames: usize) -> BlurredSequence {
    BlurredSequence::new(SynthConfig { frames, width, height, mean_blur_px: 5.0, ..SynthConfig::default() })
}

#[test]
fn poses_are_good_and_keyframes_become_sharp() {
    let sequence = sequence(240, 180, FRAMES);
    let summary = sequence.slam("run", &SlamSettings::default());
    let map = summary.map.expect("figures of the map");
    println!("{map:?}\n{:?}", summary.slam);
    let gain = map.keyframe_psnr.unwrap() - map.keyframe_psnr_captured.unwrap();
    assert!(gain > 0.8, "{gain} dB");
    assert!(map.heldout_psnr.unwrap() > 26.0, "{:?}", map.heldout_psnr);
    let trajectory = summary.trajectory.as_ref().expect("ground truth");
    assert!(trajectory.ate_m.rmse < 0.0015, "{:?}", trajectory.ate_m);
    let slam = summary.slam.expect("figures of the loop");
    assert!(slam.tracked_ate_m.unwrap() < 0.001 && slam.frames_per_second > 0.0, "{slam:?}");
    assert_eq!((slam.late_frames, slam.loops, slam.relocalisations), (0, 0, 0));

    let folder = sequence.path("run");
    let run = Run::open(&folder).unwrap();
    assert!(run.summary.complete && run.frames.iter().all(|frame| frame.status == FrameStatus::Ok));
    assert_eq!((run.exposures.len(), run.summary.slam), (FRAMES, summary.slam));
    assert_eq!(read_ply(&folder.join(MAP_FILE)).unwrap().len(), map.gaussians);
    assert_eq!(names(&folder.join("deblurred")).len(), map.keyframes);
    let left_over = names(&folder).into_iter().find(|name| name.ends_with(".partial"));
    assert_eq!(left_over, None);
}

#[test]
fn the_run_does_not_depend_on_the_number_of_threads() {
    let sequence = sequence(160, 120, 8);
    for (threads, out) in [(1, "one"), (2, "two")] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sequence.slam(out, &SlamSettings::default()));
    }
    assert_same_map(&sequence.path("one"), &sequence.path("two"));
}

#[test]
fn keyframes_beyond_the_most_are_given_up() {
    let sequence = sequence(240, 180, FRAMES);
    let summary = sequence.slam("run", &SlamSettings { max_keyframes: 3, ..SlamSettings::default() });
    assert_eq!(summary.map.unwrap().keyframes, 3);
    assert_eq!(summary.frames.keyframes, 3);
    assert!(summary.slam.unwrap().retired_keyframes >= 4);
    assert!(summary.trajectory.unwrap().ate_m.rmse < 0.002);
}
