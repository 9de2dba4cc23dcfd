//! What later frames say about the keyframe's own velocity.
//!
//! A keyframe whose rows were exposed one after the other is given one time with its own path. If its velocity was wrong
//! by `e`, the reference is sheared by `e`, and the path of every frame that is aligned with it is found too fast by the
//! same `e`: only the difference of two shears can be seen. The mid poses do not share that error. So the mean difference
//! between the velocities of the paths and those between the mid poses is the keyframe's error.

use nalgebra::SVector;

use crate::session::Walk;

/// Velocity and acceleration at the middle of a path: (translation, rotation) per second, then per square second.
pub(super) type PathRate = SVector<f64, 12>;

/// Frames after which the keyframe is corrected: whenever their number has doubled.
const FIRST_CORRECTION: usize = 1;

/// The error of the keyframe's velocity as it is known so far; (translation in the keyframe, rotation), per second.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathError {
    /// Weighted mean of the observations.
    mean: PathRate,
    /// Sum of the weights.
    weight: PathRate,
    frames: usize,
}

impl PathError {
    /// Before there is a keyframe, nothing is asked of it.
    pub(super) fn without_keyframe() -> Self {
        Self::unknown(&PathRate::repeat(1.0))
    }

    /// Nothing is known but that the error has standard deviation `sigma`.
    pub(super) fn unknown(sigma: &PathRate) -> Self {
        Self { mean: PathRate::zeros(), weight: sigma.map(|sigma| 1.0 / (sigma * sigma)), frames: 0 }
    }

    /// Visits what is known.
    pub(super) fn walk(&mut self, walk: &mut Walk<'_>) {
        walk.vector(&mut self.mean);
        walk.vector(&mut self.weight);
        walk.count(&mut self.frames);
    }

    /// Whether what was restored can be worked with.
    pub(super) fn is_sound(&self) -> bool {
        self.mean.iter().chain(&self.weight).all(|number| number.is_finite()) && self.frames < usize::MAX / 2
    }

    /// Takes in the difference between a frame's velocity along its path and that of the mid poses around it, with
    /// standard deviation `sigma`. Returns the correction of the keyframe's velocity when it is time for one.
    pub(super) fn observe(&mut self, difference: &PathRate, sigma: &PathRate) -> Option<PathRate> {
        for i in 0..12 {
            let weight = 1.0 / (sigma[i] * sigma[i]);
            self.weight[i] += weight;
            self.mean[i] += weight / self.weight[i] * (difference[i] - self.mean[i]);
        }
        self.frames += 1;
        if self.frames < FIRST_CORRECTION || !self.frames.is_power_of_two() {
            return None;
        }
        // What was observed so far has that much less error against the corrected keyframe.
        let correction = -self.mean;
        self.mean = PathRate::zeros();
        Some(correction)
    }
}
