//! Frames of a part of the sequence as they were measured, and what is thought of them.

use std::f64::consts::SQRT_2;

use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::Vector3;

use super::frame::PoseNoise;
use super::scales::Sample;
use super::spline::Part;

/// Exposures below this many seconds have no velocity.
const INSTANT: f64 = 1e-6;

/// A tracked frame of the part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    /// Mid exposure, seconds.
    pub(super) timestamp: f64,
    /// Opening and closing, seconds.
    pub(super) shutter: [f64; 2],
    pub(super) exposure: ExposureTrajectory,
    pub(super) noise: PoseNoise,
    pub(super) held: Held,
}

/// What other evidence than continuity has settled about a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Held {
    /// It is where it was measured.
    pub(super) place: bool,
    /// It runs as it was measured.
    pub(super) direction: bool,
}

impl Measured {
    pub(super) fn seconds(&self) -> f64 {
        self.shutter[1] - self.shutter[0]
    }

    pub(super) fn has_velocity(&self) -> bool {
        self.seconds() > INSTANT
    }

    /// World vector per second over the exposure; [`Self::has_velocity`] tells whether there is one.
    pub(super) fn velocity(&self, part: Part, reversed: bool) -> Vector3<f64> {
        let sign = if reversed { -1.0 } else { 1.0 };
        part.step(&self.exposure.start, &self.exposure.end) * (sign / self.seconds())
    }

    /// Standard deviation of the velocity along one axis.
    pub(super) fn velocity_sigma(&self, part: Part) -> f64 {
        SQRT_2 * self.noise_of(part) / self.seconds().max(INSTANT)
    }

    pub(super) fn noise_of(&self, part: Part) -> f64 {
        match part {
            Part::Translation => self.noise.translation,
            Part::Rotation => self.noise.rotation,
        }
    }

    pub(super) fn sample(&self) -> Sample {
        Sample { timestamp: self.timestamp, world_from_camera: self.exposure.mid() }
    }
}

/// What the path says about one exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Judgement {
    /// It was measured against time.
    pub(super) reversed: bool,
    /// It lies elsewhere.
    pub(super) outlier: bool,
}

impl Judgement {
    pub(super) fn directed(self, exposure: &ExposureTrajectory) -> ExposureTrajectory {
        if self.reversed { exposure.reversed() } else { *exposure }
    }
}
