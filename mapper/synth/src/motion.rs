//! The camera's path: a slow sweep or a round with hand shake on top, exact at any time.

use std::f64::consts::TAU;

use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::Vector3;

use super::heading::upright_camera;
use super::random::{Purpose, RowRandom};
use super::round::Round;
use super::walk::Walk;

/// A smooth to and fro over a scene that comes by the same places again. Metres, radians, seconds.
#[derive(Clone, Copy)]
pub(super) struct Sweep {
    pub(super) centre: Vector3<f64>,
    /// Amplitude of the position.
    pub(super) sway: Vector3<f64>,
    /// Heading; 0 looks along +z, positive turns towards +x.
    pub(super) yaw: f64,
    pub(super) yaw_sway: f64,
    /// Elevation, positive upward.
    pub(super) pitch: f64,
    pub(super) pitch_sway: f64,
    /// Time until the camera looks the same way again.
    pub(super) period: f64,
}

impl Sweep {
    /// `world_from_camera` at `time` on the sweep's own clock.
    fn pose(&self, time: f64) -> RigidTransform {
        let turn = TAU * time / self.period;
        let wave = Vector3::new((turn + 0.9).sin(), (1.7 * turn).sin(), (2.0 * turn + 0.4).cos());
        let yaw = self.yaw + self.yaw_sway * turn.sin();
        let pitch = self.pitch + self.pitch_sway * (1.3 * turn + 1.0).sin();
        RigidTransform::new(upright_camera(yaw, pitch), self.centre + self.sway.component_mul(&wave))
    }
}

/// Hand tremor and sway: frequencies in Hz, whose ratios are irrational in practice so that the motion never
/// repeats, and the share of each in the squared speed, most of it between 2 and 7 Hz.
const SHAKE: [(f64, f64); 6] =
    [(1.13, 0.06), (1.91, 0.14), (3.07, 0.25), (4.73, 0.27), (6.67, 0.18), (8.89, 0.10)];

/// Speed of the shake at strength 1 about the camera's x, y, z axis, radians per second (RMS).
const TURN_SPEED: [f64; 3] = [0.16, 0.16, 0.08];

/// Speed of the shake at strength 1 along the world's axes, metres per second (RMS).
const SHIFT_SPEED: [f64; 3] = [0.04, 0.04, 0.04];

/// Furthest that the shake takes the camera off the sweep along one axis, metres: an arm's play.
const FURTHEST_SHIFT: f64 = 0.12;

/// Furthest turn off the sweep about one axis, radians.
const FURTHEST_TURN: f64 = 0.9;

/// Sum of sinusoids.
#[derive(Clone)]
struct Tremor {
    /// Amplitude, angular frequency (rad/s) and phase.
    waves: [(f64, f64, f64); SHAKE.len()],
}

impl Tremor {
    fn new(speed: f64, random: &mut RowRandom) -> Self {
        let waves = SHAKE.map(|(hertz, share)| {
            let frequency = TAU * hertz * (0.94 + 0.12 * f64::from(random.uniform()));
            let amplitude = speed * (2.0 * share).sqrt() / frequency;
            (amplitude, frequency, TAU * f64::from(random.uniform()))
        });
        Self { waves }
    }

    fn at(&self, time: f64) -> f64 {
        self.waves
            .iter()
            .map(|(amplitude, frequency, phase)| amplitude * (frequency * time + phase).sin())
            .sum()
    }

    fn largest(&self) -> f64 {
        self.waves.iter().map(|(amplitude, ..)| amplitude).sum()
    }
}

/// The motion that a hand shakes on top of.
#[derive(Clone, Copy)]
pub(super) enum Steady {
    /// Slower where less blur is asked for.
    Sweep(Sweep),
    /// A whole round from time `begin` on within `duration` seconds.
    Round { round: Round, begin: f64, duration: f64 },
    /// From room to room.
    Walk(Walk),
}

impl Steady {
    fn pose(&self, time: f64, strength: f64) -> RigidTransform {
        match self {
            Self::Sweep(sweep) => sweep.pose(time * strength.min(1.0)),
            Self::Round { round, begin, duration } => round.pose((time - begin) / duration),
            Self::Walk(walk) => walk.pose(time),
        }
    }
}

/// The camera's continuous path.
#[derive(Clone)]
pub(super) struct CameraPath {
    steady: Steady,
    turns: [Tremor; 3],
    shifts: [Tremor; 3],
    calm_phase: f64,
    strength: f64,
}

impl CameraPath {
    /// The path with hand shake of strength 1.
    pub(super) fn new(steady: Steady, seed: u64) -> Self {
        let mut random = RowRandom::new(seed, Purpose::Shake, 0, 0);
        Self {
            steady,
            turns: TURN_SPEED.map(|speed| Tremor::new(speed, &mut random)),
            shifts: SHIFT_SPEED.map(|speed| Tremor::new(speed, &mut random)),
            calm_phase: TAU * f64::from(random.uniform()),
            strength: 1.0,
        }
    }

    /// The same path at another strength of the shake. A sweep stands still at 0 and is itself faster up to 1.
    pub(super) fn with_strength(&self, strength: f64) -> Self {
        Self { strength, ..self.clone() }
    }

    /// The largest sensible strength: beyond it the hand would turn the camera away from the scene.
    pub(super) fn strongest(&self) -> f64 {
        let largest = self.turns.iter().map(Tremor::largest).fold(0.0, f64::max);
        FURTHEST_TURN / largest
    }

    /// `world_from_camera` at `time`, seconds.
    pub(super) fn pose(&self, time: f64) -> RigidTransform {
        let steady = self.steady.pose(time, self.strength);
        let shake = self.strength * calm(time, self.calm_phase);
        let turn = Vector3::from_fn(|axis, _| shake * self.turns[axis].at(time));
        let shift = Vector3::from_fn(|axis, _| {
            let shift = shake * self.shifts[axis].at(time);
            FURTHEST_SHIFT * (shift / FURTHEST_SHIFT).tanh()
        });
        RigidTransform {
            rotation: so3::renormalised(&(steady.rotation * so3::exp(&turn))),
            translation: steady.translation + shift,
        }
    }
}

/// Nobody shakes evenly: a factor from 0.4 to 1 that comes and goes within two seconds.
fn calm(time: f64, phase: f64) -> f64 {
    0.7 + 0.3 * (TAU * 0.47 * time + phase).sin()
}
