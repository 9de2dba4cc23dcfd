//! What an IMU at the camera's centre, with its axes, records.

use std::fmt::Write as _;

use nalgebra::Vector3;

use super::SynthSequence;
use super::random::{Purpose, RowRandom};

/// Samples per second.
const HERTZ: f64 = 200.0;

/// Recorded time before the first frame and after the last, seconds.
const MARGIN: f64 = 0.3;

/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.806_65;

/// Constant errors of a telephone's sensors (standard deviations for each axis; rad/s and m/s^2).
const BIAS: [f64; 2] = [0.006, 0.03];

/// Errors of each sample of such sensors at 200 Hz (standard deviations for each axis; rad/s and m/s^2).
const NOISE: [f64; 2] = [0.002, 0.02];

/// Constant errors of the gyroscope (rad/s) and of the accelerometer (m/s^2) of this seed.
pub(super) fn biases(seed: u64) -> [Vector3<f64>; 2] {
    let mut random = RowRandom::new(seed, Purpose::Inertial, 0, 1);
    BIAS.map(|sigma| normal(&mut random) * sigma)
}

/// `imu.csv`: angular velocity and specific force in camera axes, with bias and noise.
pub(super) fn table(sequence: &SynthSequence) -> String {
    let mut text = String::from("timestamp,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2\n");
    let seed = sequence.config().seed;
    let [rate_bias, force_bias] = biases(seed);
    let from = sequence.timestamp(0) - MARGIN;
    let until = sequence.timestamp(sequence.len() - 1) + MARGIN;
    let samples = ((until - from) * HERTZ).round() as usize;
    for sample in 0..=samples {
        let time = from + sample as f64 / HERTZ;
        let mut random = RowRandom::new(seed, Purpose::Inertial, sample, 0);
        let rate = sequence.angular_velocity(time) + rate_bias + normal(&mut random) * NOISE[0];
        let force = specific_force(sequence, time) + force_bias + normal(&mut random) * NOISE[1];
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{time:.6},{:.6},{:.6},{:.6},{:.6},{:.6},{:.6}",
            rate.x, rate.y, rate.z, force.x, force.y, force.z
        );
    }
    text
}

/// What an accelerometer without errors feels: acceleration and the support against gravity, in camera axes, m/s^2.
fn specific_force(sequence: &SynthSequence, time: f64) -> Vector3<f64> {
    let upward = Vector3::y() * GRAVITY;
    sequence.world_from_camera(time).rotation.inverse() * (sequence.acceleration(time) + upward)
}

/// Three independent standard normal numbers.
fn normal(random: &mut RowRandom) -> Vector3<f64> {
    let [x, y] = random.normal_pair();
    let [z, _] = random.normal_pair();
    Vector3::new(f64::from(x), f64::from(y), f64::from(z))
}
