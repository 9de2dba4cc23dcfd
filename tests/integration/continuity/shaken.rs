//! Noisy exposures of a shaken camera, with and without faults.

use mba_mapper::continuity::{ContinuityFrame, PoseNoise};
use mba_mapper::synth::{SynthConfig, SynthSequence};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{Vector3, Vector6};

/// Frames of every sequence.
pub(crate) const FRAMES: usize = 90;

/// Half the width of the uniform noise of every pose, metres and radians along one axis.
const NOISE: [f64; 2] = [1e-3, 5e-4];

/// The true exposures of a shake of some pixels and what a tracker would make of them.
pub(crate) struct Shaken {
    pub(crate) truth: Vec<ExposureTrajectory>,
    pub(crate) frames: Vec<ContinuityFrame>,
}

impl Shaken {
    pub(crate) fn new(seed: u64, mean_blur_px: f64) -> Self {
        let config = SynthConfig {
            frames: FRAMES,
            mean_blur_px,
            seed,
            width: 160,
            height: 120,
            ..SynthConfig::default()
        };
        let sequence = SynthSequence::new(config.clone()).expect("a valid configuration");
        let mut draw = Uniform::new(seed);
        let truth: Vec<ExposureTrajectory> = (0..FRAMES).map(|k| sequence.exposure(k)).collect();
        let frames = truth.iter().enumerate().map(|(k, exposure)| {
            let measured = ExposureTrajectory {
                start: exposure.start.perturbed(&noise(&mut draw)),
                end: exposure.end.perturbed(&noise(&mut draw)),
            };
            ContinuityFrame {
                timestamp: sequence.timestamp(k),
                exposure_seconds: config.exposure_seconds,
                world_from_camera: measured,
                noise: Some(PoseNoise::typical(&measured)),
                trusted: true,
            }
        });
        Self { frames: frames.collect(), truth }
    }

    pub(crate) fn swap(&mut self, k: usize) {
        self.frames[k].world_from_camera = self.frames[k].world_from_camera.reversed();
    }

    /// Moves the whole exposure.
    pub(crate) fn misplace(&mut self, k: usize, offset: &Vector6<f64>) {
        let exposure = self.frames[k].world_from_camera;
        self.frames[k].world_from_camera = ExposureTrajectory {
            start: exposure.start.perturbed(offset),
            end: exposure.end.perturbed(offset),
        };
    }

    /// Holds the pose of the frame before, as the tracker does.
    pub(crate) fn lose(&mut self, k: usize) {
        let held = self.frames[k - 1].world_from_camera.mid();
        self.frames[k].world_from_camera = ExposureTrajectory::still(held);
        self.frames[k].noise = None;
    }

    /// Distance (metres) and angle (radians) of the worse end of an exposure from the truth.
    pub(crate) fn errors(&self, k: usize, found: &ExposureTrajectory) -> (f64, f64) {
        let apart = |a: &RigidTransform, b: &RigidTransform| {
            let difference = a.tangent_to(b);
            (difference.fixed_rows::<3>(0).norm(), difference.fixed_rows::<3>(3).norm())
        };
        let start = apart(&self.truth[k].start, &found.start);
        let end = apart(&self.truth[k].end, &found.end);
        (start.0.max(end.0), start.1.max(end.1))
    }
}

fn noise(draw: &mut Uniform) -> Vector6<f64> {
    Vector6::from_fn(|row, _| draw.within(-NOISE[row / 3], NOISE[row / 3]))
}

/// An offset of 5 to 20 cm and 5 to 20 degrees.
pub(crate) fn gross_offset(draw: &mut Uniform) -> Vector6<f64> {
    let mut along = |length: f64| {
        let direction = Vector3::from_fn(|_, _| draw.within(-1.0, 1.0));
        direction * (length / direction.norm().max(1e-3))
    };
    let (shift, turn) = (along(1.0), along(1.0));
    let (metres, degrees) = (draw.within(0.05, 0.2), draw.within(5.0, 20.0));
    let (shift, turn) = (shift * metres, turn * degrees.to_radians());
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}
