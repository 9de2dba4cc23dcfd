//! A walk through a row of rooms: once round a room, on through a door, back again, and further.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector3;

use super::heading::upright_camera;

/// Distance between the centres of two rooms, metres.
pub(super) const ROOM: f64 = 7.0;

/// Time between two points of the way, seconds.
const STEP_SECONDS: f64 = 25.0 / 30.0;

/// Points on a round that goes on through the other door, and on one that goes back: an eighth of a turn each.
const STRAIGHT: usize = 8;
const BACK: usize = 12;

/// Points on the way from room to room, each about a metre after the other.
const CROSSING: usize = 7;

/// Rounds in a room, in the next one and in the first again, each with the way to the next; then the same one room further on.
const LEGS: [(usize, usize); 3] = [(0, STRAIGHT), (1, BACK), (0, BACK)];

/// Middle of a round in the first room, and its half axes along x and z, metres.
const CENTRE: Vector3<f64> = Vector3::new(0.0, 1.42, -0.5);
const RADII: [f64; 2] = [0.9, 0.5];

/// Elevation of the camera and how much it goes up and down, radians.
const PITCH: (f64, f64) = (-0.17, 0.06);

/// A walk of any length.
#[derive(Clone, Copy)]
pub(super) struct Walk {
    /// Time at its begin, seconds.
    pub(super) begin: f64,
}

/// Where the way leads past.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    place: Vector3<f64>,
    yaw: f64,
}

impl Walk {
    /// `world_from_camera` at `time`, seconds: smooth to the second derivative, on a cubic B-spline.
    pub(super) fn pose(&self, time: f64) -> RigidTransform {
        let steps = ((time - self.begin) / STEP_SECONDS).max(0.0) + 1.0;
        let (before, t) = (steps.floor() as usize - 1, steps.fract());
        // Basis of the uniform cubic B-spline.
        let weights = [
            (1.0 - t).powi(3) / 6.0,
            (3.0 * t.powi(3) - 6.0 * t * t + 4.0) / 6.0,
            (-3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0) / 6.0,
            t.powi(3) / 6.0,
        ];
        let (mut place, mut yaw) = (Vector3::zeros(), 0.0);
        for (k, weight) in weights.into_iter().enumerate() {
            let point = point(before + k);
            place += point.place * weight;
            yaw += point.yaw * weight;
        }
        // Up and down once in eleven steps.
        let pitch = PITCH.0 + PITCH.1 * (TAU * steps / 11.0).sin();
        RigidTransform::new(upright_camera(yaw, pitch), place)
    }

    /// Rooms that a walk of so many seconds comes into or looks into.
    pub(super) fn rooms(seconds: f64) -> usize {
        // The spline needs three points beyond its last step.
        let last = (seconds / STEP_SECONDS).ceil() as usize + 3;
        let furthest = (0..=last).map(|k| point(k).place.x).fold(0.0, f64::max);
        (furthest / ROOM).round() as usize + 2
    }
}

/// Point `k` of the way.
fn point(k: usize) -> Point {
    let points_of_turn = LEGS.iter().map(|(_, round)| round + CROSSING).sum::<usize>();
    let eighths_of_turn = LEGS.iter().map(|(_, round)| round).sum::<usize>();
    let turn = k / points_of_turn;
    let (mut leg, mut k, mut eighths) = (0, k % points_of_turn, turn * eighths_of_turn);
    while k >= LEGS[leg].1 + CROSSING {
        k -= LEGS[leg].1 + CROSSING;
        eighths += LEGS[leg].1;
        leg += 1;
    }
    let (room, round) = LEGS[leg];
    // All round to the right, looking outward; at its begin away from the door, at its end towards one.
    let yaw = FRAC_PI_2 + FRAC_PI_4 * (eighths + k.min(round)) as f64;
    let on_round =
        Vector3::new(RADII[0] * yaw.sin() + ROOM * (room + turn) as f64, 0.0, RADII[1] * yaw.cos());
    let through_door = k.saturating_sub(round) as f64 / CROSSING as f64 * ROOM * yaw.sin();
    Point { place: CENTRE + on_round + Vector3::new(through_door, 0.0, 0.0), yaw }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_goes_on_from_room_to_room_and_through_doors_only() {
        let walk = Walk { begin: 0.0 };
        let rooms = |seconds: f64| {
            let times = (0..(seconds * 10.0) as usize).map(|k| 0.1 * k as f64);
            let mut rooms: Vec<usize> =
                times.map(|time| (walk.pose(time).translation.x / ROOM).round() as usize).collect();
            rooms.dedup();
            rooms
        };
        // 225, 1000 and 2000 frames at 30 Hz.
        assert_eq!(rooms(225.0 / 30.0), [0]);
        assert_eq!(rooms(1000.0 / 30.0), [0, 1, 0]);
        assert_eq!(rooms(2000.0 / 30.0), [0, 1, 0, 1, 2]);
        assert_eq!((Walk::rooms(8.0), Walk::rooms(2000.0 / 30.0)), (3, 4));
        for k in 0..6000 {
            let pose = walk.pose(0.02 * f64::from(k));
            let from_wall = (pose.translation.x / ROOM - 0.5).fract().abs();
            let is_in_door = !(0.1..0.9).contains(&from_wall);
            assert!(!is_in_door || (pose.translation.z - CENTRE.z).abs() < 0.05, "{pose:?}");
            let next = walk.pose(0.02 * f64::from(k + 1));
            let speed = (next.translation - pose.translation).norm() / 0.02;
            let turn = next.rotation.angle_to(&pose.rotation) / 0.02;
            assert!(speed < 1.4 && turn < 1.2, "{speed} m/s, {turn} rad/s");
        }
    }
}
