//! The motion during an exposure that its neighbours suggest.

use mba_mapper::continuity::{ContinuitySettings, predict_motions};
use nalgebra::{Vector3, Vector6};

use crate::shaken::{FRAMES, Shaken};

fn part(motion: &Vector6<f64>, first: usize) -> Vector3<f64> {
    Vector3::from(motion.fixed_rows::<3>(first))
}

#[test]
fn predictions_are_as_exact_as_they_say() {
    let shaken = Shaken::new(1, 6.0);
    let predictions = predict_motions(&shaken.frames, &ContinuitySettings::default());
    let mut squares = [0.0; 2];
    let mut forward = 0;
    for (k, prediction) in predictions.iter().enumerate() {
        let Some(prediction) = prediction else { continue };
        let truth = shaken.truth[k].motion();
        let error = prediction.motion - truth;
        squares[0] += (part(&error, 0) / prediction.translation_sigma).norm_squared();
        squares[1] += (part(&error, 3) / prediction.rotation_sigma).norm_squared();
        forward += usize::from(part(&truth, 3).dot(&part(&prediction.motion, 3)) > 0.0);
    }
    // Three axes of unit variance would give 3; measured motions, which calibrate, have noise of their own.
    for sum in squares {
        let mean = sum / (FRAMES - 2) as f64;
        assert!((0.3..6.0).contains(&mean), "{mean} squared standard deviations");
    }
    assert!(forward > (FRAMES - 2) * 9 / 10, "{forward} in the right direction");
}

#[test]
fn a_frame_without_both_neighbours_has_no_prediction() {
    let mut shaken = Shaken::new(2, 4.0);
    shaken.lose(30);
    let predictions = predict_motions(&shaken.frames, &ContinuitySettings::default());
    let absent: Vec<usize> = (0..FRAMES).filter(|&k| predictions[k].is_none()).collect();
    assert_eq!(absent, [0, 29, 30, 31, FRAMES - 1]);
    for few in 0..3 {
        let predictions = predict_motions(&shaken.frames[..few], &ContinuitySettings::default());
        assert_eq!(predictions, vec![None; few]);
    }
}

#[test]
fn swapped_exposures_do_not_change_predictions() {
    let shaken = Shaken::new(3, 6.0);
    let mut swapped = Shaken::new(3, 6.0);
    (10..20).for_each(|k| swapped.swap(k));
    let settings = ContinuitySettings::default();
    let expected = predict_motions(&shaken.frames, &settings);
    for (a, b) in expected.iter().zip(predict_motions(&swapped.frames, &settings)).skip(1).take(FRAMES - 2) {
        let (a, b) = (a.expect("neighbours"), b.expect("neighbours"));
        assert!((a.motion - b.motion).norm() < 1e-9);
    }
}
