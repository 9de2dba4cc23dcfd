//! Faults are found and repaired, and nothing else is touched.

use mba_mapper::continuity::{Continuity, ContinuitySettings, FrameVerdict, repair};
use mba_tests::transfer_scene::Uniform;
use nalgebra::Vector6;

use crate::shaken::{FRAMES, Shaken, gross_offset};

fn repaired(shaken: &Shaken) -> Continuity {
    repair(&shaken.frames, &ContinuitySettings::default()).expect("valid frames")
}

/// Rotation during the exposure in radians from which its direction has to be found: twenty standard deviations.
const CLEAR_TURN: f64 = 0.01;

#[test]
fn a_sound_sequence_comes_back_bit_for_bit() {
    for (seed, blur) in [(1, 0.5), (2, 4.0), (3, 8.0)] {
        let shaken = Shaken::new(seed, blur);
        let result = repaired(&shaken);
        assert_eq!(result.frames_with(FrameVerdict::Kept).len(), FRAMES, "seed {seed}");
        assert!(shaken.frames.iter().zip(&result.exposures).all(|(frame, e)| frame.world_from_camera == *e));
        assert_eq!(result.energy.measured, result.energy.repaired);
    }
}

#[test]
fn a_fifth_of_swapped_exposures_is_turned_back() {
    let mut clear = 0;
    for seed in 1..=3 {
        let mut shaken = Shaken::new(seed, 6.0);
        let mut draw = Uniform::new(seed);
        let swapped: Vec<usize> = (0..FRAMES).filter(|_| draw.within(0.0, 1.0) < 0.2).collect();
        swapped.iter().for_each(|&k| shaken.swap(k));
        let result = repaired(&shaken);
        let reversed = result.frames_with(FrameVerdict::Reversed);
        assert!(reversed.iter().all(|k| swapped.contains(k)), "seed {seed}: {reversed:?} of {swapped:?}");
        let inside = |k: &&usize| (1..FRAMES - 1).contains(*k);
        for &k in swapped.iter().filter(inside) {
            let is_clear = shaken.truth[k].rotation_vector().norm() > CLEAR_TURN;
            clear += usize::from(is_clear);
            assert!(!is_clear || reversed.contains(&k), "seed {seed}: frame {k} still runs backwards");
        }
        for &k in &reversed {
            assert_eq!(result.exposures[k], shaken.frames[k].world_from_camera.reversed());
        }
        assert!(result.frames_with(FrameVerdict::Replaced).is_empty());
        assert!(result.energy.repaired < 0.2 * result.energy.measured, "{:?}", result.energy);
    }
    assert!(clear > 20, "only {clear} swapped frames were blurred");
}

#[test]
fn swapped_misplaced_and_lost_frames_are_all_recovered() {
    let mut shaken = Shaken::new(4, 6.0);
    let mut draw = Uniform::new(4);
    let (misplaced, lost) = ([9, 23, 41, 42, 60, 77], [15, 33, 34, 52, 70]);
    let swapped: Vec<usize> = (1..FRAMES - 1)
        .filter(|k| !misplaced.contains(k) && !lost.contains(k) && draw.within(0.0, 1.0) < 0.2)
        .collect();
    swapped.iter().for_each(|&k| shaken.swap(k));
    misplaced.iter().for_each(|&k| shaken.misplace(k, &gross_offset(&mut draw)));
    lost.iter().for_each(|&k| shaken.lose(k));

    let result = repaired(&shaken);
    assert_eq!(result.frames_with(FrameVerdict::Replaced), misplaced);
    assert_eq!(result.frames_with(FrameVerdict::Bridged), lost);
    let reversed = result.frames_with(FrameVerdict::Reversed);
    assert!(reversed.iter().all(|k| swapped.contains(k)), "{reversed:?} of {swapped:?}");
    for &k in misplaced.iter().chain(&lost) {
        let (metres, radians) = shaken.errors(k, &result.exposures[k]);
        // At its worse end. The shake of 24 px (at 640 columns) moves 41 and 42 twice as far while both are missing.
        assert!(metres < 0.01 && radians < 0.015, "frame {k}: {metres} m, {radians} rad");
    }
    let still_backwards = swapped.iter().filter(|k| {
        let turn = shaken.truth[**k].rotation_vector();
        turn.norm() > CLEAR_TURN && turn.dot(&result.exposures[**k].rotation_vector()) < 0.0
    });
    assert_eq!(still_backwards.count(), 0);
}

#[test]
fn the_first_and_the_last_frame_are_judged_too() {
    let mut shaken = Shaken::new(5, 4.0);
    let offset = Vector6::new(0.15, 0.0, -0.1, 0.0, 0.2, 0.1);
    for k in [0, FRAMES - 1] {
        shaken.misplace(k, &offset);
    }
    let result = repaired(&shaken);
    assert_eq!(result.frames_with(FrameVerdict::Replaced), [0, FRAMES - 1]);
    for k in [0, FRAMES - 1] {
        // Continued from one side: a third of what the frame was off is what can be asked for.
        let (metres, radians) = shaken.errors(k, &result.exposures[k]);
        assert!(metres < 0.06 && radians < 0.075, "frame {k}: {metres} m, {radians} rad");
    }
}

#[test]
fn a_step_to_another_opinion_about_the_world_is_no_outlier() {
    // Everything after frame 45 is 10 cm aside: no frame is wrong on its own.
    let mut shaken = Shaken::new(6, 4.0);
    for k in 45..FRAMES {
        shaken.misplace(k, &Vector6::new(0.1, 0.0, 0.0, 0.0, 0.0, 0.0));
    }
    let result = repaired(&shaken);
    assert!(result.frames_with(FrameVerdict::Replaced).len() <= 4);
    for k in (0..40).chain(50..FRAMES) {
        assert_eq!(result.verdicts[k], FrameVerdict::Kept, "frame {k}");
    }
}

#[test]
fn a_long_loss_stays_unresolved_and_cuts_the_sequence() {
    let mut shaken = Shaken::new(7, 6.0);
    (40..55).for_each(|k| shaken.lose(k));
    shaken.swap(20);
    let result = repaired(&shaken);
    assert_eq!(result.frames_with(FrameVerdict::Unresolved), (40..55).collect::<Vec<_>>());
    assert_eq!(result.exposures[47], shaken.frames[47].world_from_camera);
    assert_eq!(result.verdicts[20], FrameVerdict::Reversed);
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let mut shaken = Shaken::new(8, 6.0);
    shaken.misplace(30, &Vector6::new(0.1, 0.0, 0.0, 0.0, 0.0, 0.2));
    shaken.swap(50);
    let with_threads = |count| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a pool");
        pool.install(|| repaired(&shaken))
    };
    assert_eq!(with_threads(1), with_threads(4));
}
