//! Focal length: the one with which the frames fit each other best.

use mba_io::dataset::{Dataset, Knowledge};
use rayon::prelude::*;

use super::finding::{Finding, Value};
use super::score::{advantage, misfits, parabola, trimmed_mean};
use super::window::{Guess, Recording};
use crate::tracking::TrackingOptions;

/// Frames that are tracked with each focal length, at the most.
const FRAMES: usize = 80;

/// Factors on the focal length that are tried around the best one, in turn.
const STEPS: [&[f64]; 3] = [
    &[-0.06, -0.045, -0.03, -0.015, 0.0, 0.015, 0.03, 0.045, 0.06],
    &[-0.012, -0.008, -0.004, 0.0, 0.004, 0.008, 0.012],
    &[-0.008, -0.006, -0.004, -0.002, 0.0, 0.002, 0.004, 0.006, 0.008],
];

/// The ends of the last steps must fit worse than the best by this many standard deviations.
const MIN_CERTAINTY: f64 = 1.5;

/// Looks for the factor on the focal lengths on record with which the frames fit each other best. Returns what was
/// found, in pixels along x, and the factor if the recording tells one.
#[must_use]
pub fn focal_length(dataset: &Dataset) -> (Finding, Option<f64>) {
    let options = TrackingOptions::default();
    let recording = Recording { dataset, options: &options };
    let frames = recording.read(0..FRAMES.min(dataset.len()), 0);
    let probe = |focal_scale: f64| {
        let guess = Guess { focal_scale, ..Guess::of(dataset) };
        misfits(&recording.track(&frames, 0, &guess))
    };
    let height = |misfits: &[f64]| trimmed_mean(misfits).map_or(f64::INFINITY, |mean| mean.median);
    let mut centre = 1.0;
    let mut found = None;
    for steps in STEPS {
        let tries: Vec<(f64, Vec<f64>)> =
            steps.par_iter().map(|step| centre * (1.0 + step)).map(|scale| (scale, probe(scale))).collect();
        let points: Vec<(f64, f64)> =
            tries.iter().map(|(scale, misfits)| (*scale, height(misfits))).collect();
        let Some(best) = (0..points.len()).min_by(|a, b| points[*a].1.total_cmp(&points[*b].1)) else {
            break;
        };
        let reach = steps[steps.len() - 1];
        let bottom = parabola(&points).filter(|p| (p.bottom / centre - 1.0).abs() <= reach);
        let ends = [&tries[0].1, &tries[tries.len() - 1].1];
        let is_certain = ends.iter().all(|end| {
            advantage(&tries[best].1, end).is_some_and(|gain| gain.median > MIN_CERTAINTY * gain.sigma)
        });
        found = bottom.filter(|_| is_certain);
        // The parabola holds near the bottom only, so the first steps go to the best try.
        centre = found.map_or(points[best].0, |p| p.bottom);
    }
    let focal = dataset.calibration().camera.fx;
    match found {
        Some(p) => {
            let value = Value { value: p.bottom * focal, sigma: p.sigma * focal, printed: (1.0, "px") };
            let note = format!("{:+.2} % of what the calibration says", 100.0 * (p.bottom - 1.0));
            let finding =
                Finding { fact: "focal_length", knowledge: Knowledge::Estimated, value: Some(value), note };
            (finding, Some(p.bottom))
        }
        None => {
            let note = "the frames fit as well with others".to_owned();
            (Finding { fact: "focal_length", knowledge: Knowledge::Assumed, value: None, note }, None)
        }
    }
}
