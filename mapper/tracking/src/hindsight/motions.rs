//! How the camera moves around every frame, from the poses and exposures of the frames on both sides of it.
//!
//! A hand that shakes turns round within two or three frames: mid poses alone, 33 ms apart, do not show it. Mid poses and the
//! velocities within the exposures do. Both are known to a part of a pixel in what they move in the picture, and much less well
//! in what hardly shows there, as a turn and a shift that cancel; so a pixel is the unit of what is believed.

use mba_tracker::ExpectedPath;
use mba_tracker::geometry::PinholeCamera;
use nalgebra::{Matrix6, Vector6};

use super::sightings::Sighting;
use super::smoother::{Evidence, Measurement, Smoothed, smooth};

/// Frames on each side that are asked how a frame moved.
const REACH: usize = 3;

/// Seconds to a neighbour beyond which it says nothing about the frame.
const MAX_GAP: f64 = 0.25;

/// Standard deviation in pixels of where a frame is against its neighbours. Only its ratio to the next matters: how large both
/// are in a recording is learnt.
const PLACE_PIXELS: f64 = 0.5;

/// Standard deviation of the blur of an exposure, pixels, and what exposure times are wrong by, as a share of the blur.
const BLUR_PIXELS: f64 = 0.3;
const BLUR_SHARE: f64 = 0.03;

/// Powers of ten that are tried for the spectral density of what moves the camera, in square metres and square radians per
/// frame interval to the ninth: from a dolly to a shake that turns round within two frames.
const DRIVES: std::ops::RangeInclusive<i32> = -9..=3;

/// Windows that the density is learnt from: enough for one number, and few enough that long recordings take no longer.
const LEARNT_FROM: usize = 64;

/// Motions of a recording.
#[derive(Debug)]
pub(super) struct Motions<'a> {
    sightings: &'a [Option<Sighting>],
    /// Squared pixels, on average over the picture, that a motion of the camera moves a point by.
    flow: Matrix6<f64>,
    /// Seconds between frames.
    interval: f64,
    /// Likeliest spectral density of what moves the camera.
    drive: f64,
    /// Variance of what was measured, as a multiple of what is written above.
    variance: f64,
}

impl<'a> Motions<'a> {
    /// Learns how the camera of `sightings` is moved, one for each frame, `None` where a frame is not known for certain.
    /// `depth` is a usual one, metres; `interval` the usual time between frames, seconds.
    pub(super) fn of(
        sightings: &'a [Option<Sighting>],
        camera: &PinholeCamera,
        depth: f64,
        interval: f64,
    ) -> Self {
        let flow = mean_squared_flow(camera, depth);
        let mut motions = Self { sightings, flow, interval, drive: 1.0, variance: 1.0 };
        let step = sightings.len().div_ceil(LEARNT_FROM).max(1);
        let windows: Vec<_> = (0..sightings.len()).step_by(step).filter_map(|k| motions.window(k)).collect();
        let mut least = f64::INFINITY;
        for drive in DRIVES.map(|power| 10_f64.powi(power)) {
            let mut evidence = Evidence::default();
            for (measurements, centre) in &windows {
                if let Some((_, one)) = smooth(measurements, *centre, drive) {
                    evidence.add(&one);
                }
            }
            let cost = evidence.cost();
            if let Some(variance) = evidence.variance().filter(|_| cost < least) {
                (least, motions.drive, motions.variance) = (cost, drive, variance);
            }
        }
        motions
    }

    /// The motion around frame `index`; `None` when no neighbour is near enough to tell.
    pub(super) fn around(&self, index: usize) -> Option<ExpectedPath> {
        let (measurements, centre) = self.window(index)?;
        let (Smoothed { derivatives, variances }, _) = smooth(&measurements, centre, self.drive)?;
        let per = |order: i32| self.interval.powi(-order);
        let sigma = |order: usize, group: usize| {
            let variance = variances[order].fixed_rows::<3>(3 * group).mean() * self.variance;
            variance.max(0.0).sqrt()
        };
        Some(ExpectedPath {
            velocity: derivatives[0] * per(1),
            acceleration: derivatives[1] * per(2),
            jerk: derivatives[2] * per(3),
            velocity_sigma: [0, 1].map(|group| sigma(0, group) * per(1)),
            acceleration_sigma: [0, 1].map(|group| sigma(1, group) * per(2)),
        })
    }

    /// What was measured around frame `index`, in its axes, and which of it is the frame's own.
    fn window(&self, index: usize) -> Option<(Vec<Measurement>, usize)> {
        let frame = self.sightings[index].as_ref()?;
        let near = index.saturating_sub(REACH)..=(index + REACH).min(self.sightings.len() - 1);
        let known = self.sightings[near].iter().flatten();
        let mut measurements: Vec<Measurement> = known
            .filter(|other| (other.time - frame.time).abs() <= MAX_GAP)
            .map(|other| self.measurement(frame, other))
            .collect();
        measurements.sort_by(|a, b| a.time.total_cmp(&b.time));
        // Frames at one time say nothing of how fast the camera was.
        measurements.dedup_by(|later, earlier| later.time <= earlier.time);
        let centre = measurements.iter().position(|measurement| measurement.time == 0.0)?;
        (measurements.len() > 1).then_some((measurements, centre))
    }

    fn measurement(&self, frame: &Sighting, other: &Sighting) -> Measurement {
        let (place, velocity) = frame.seen_from_here(other);
        let velocity = velocity.map(|velocity| {
            // Over an exposure the picture moves by the blur.
            let exposed = other.exposure / self.interval;
            let velocity = velocity * self.interval;
            let blur = velocity.dot(&(self.flow * velocity)).max(0.0).sqrt() * exposed;
            let variance = BLUR_PIXELS.powi(2) + (BLUR_SHARE * blur).powi(2);
            (velocity, self.flow * (exposed * exposed / variance))
        });
        Measurement {
            time: (other.time - frame.time) / self.interval,
            place: (place, self.flow / PLACE_PIXELS.powi(2)),
            velocity,
        }
    }
}

/// Mean over the picture, and over depths around `depth`, of the squared pixels by which a motion of the camera (translation,
/// rotation vector) moves a point: a quadratic form.
fn mean_squared_flow(camera: &PinholeCamera, depth: f64) -> Matrix6<f64> {
    // A coarse grid suffices for a mean; the depths are those of a room.
    const GRID: [usize; 2] = [8, 6];
    const DEPTHS: [f64; 3] = [0.6, 1.0, 1.7];
    let mut sum = Matrix6::zeros();
    for cell in 0..GRID[0] * GRID[1] {
        let (column, row) = (cell % GRID[0], cell / GRID[0]);
        let x = ((column as f64 + 0.5) / GRID[0] as f64 * camera.width as f64 - camera.cx) / camera.fx;
        let y = ((row as f64 + 0.5) / GRID[1] as f64 * camera.height as f64 - camera.cy) / camera.fy;
        for inverse_depth in DEPTHS.map(|ratio| 1.0 / (ratio * depth)) {
            // Signs are those of points that move against a still camera; squares do not tell.
            let along_x = Vector6::new(inverse_depth, 0.0, -x * inverse_depth, -x * y, 1.0 + x * x, -y);
            let along_y = Vector6::new(0.0, inverse_depth, -y * inverse_depth, -(1.0 + y * y), x * y, x);
            for (gradient, focal) in [(along_x, camera.fx), (along_y, camera.fy)] {
                sum += gradient * gradient.transpose() * (focal * focal);
            }
        }
    }
    sum / (GRID[0] * GRID[1] * DEPTHS.len()) as f64
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    const DT: f64 = 1.0 / 30.0;

    fn camera() -> PinholeCamera {
        PinholeCamera { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5 }
    }

    /// A camera that is shaken sideways and about its axis, four times a second, with an exposure of 10 ms.
    fn shaken(time: f64) -> Sighting {
        let (phase, rate) = (25.0 * time, 25.0);
        let world_from_mid = RigidTransform {
            rotation: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.05 * phase.sin()),
            translation: Vector3::new(0.0, 0.0, 0.03 * phase.cos()),
        };
        let velocity =
            Vector6::new(0.0, 0.0, -0.03 * rate * phase.sin(), 0.0, 0.0, 0.05 * rate * phase.cos());
        Sighting { time, exposure: 0.01, world_from_mid, velocity: Some(velocity) }
    }

    fn shake(frames: usize) -> Vec<Option<Sighting>> {
        (0..frames).map(|k| Some(shaken(k as f64 * DT))).collect()
    }

    #[test]
    fn a_shake_is_followed_between_its_frames() {
        let sightings = shake(20);
        let motions = Motions::of(&sightings, &camera(), 2.0, DT);
        for index in [5, 10, 14] {
            let (found, phase) = (motions.around(index).unwrap(), 25.0 * index as f64 * DT);
            let turn = [0.05 * 25.0 * phase.cos(), -0.05 * 625.0 * phase.sin()];
            let shift = [-0.03 * 25.0 * phase.sin(), -0.03 * 625.0 * phase.cos()];
            // Of speeds of 1.25 and 0.75, accelerations of 31 and 19, and a jerk of 780.
            assert!((found.velocity[5] - turn[0]).abs() < 0.02, "{} {}", found.velocity[5], turn[0]);
            assert!((found.velocity[2] - shift[0]).abs() < 0.02, "{} {}", found.velocity[2], shift[0]);
            assert!((found.acceleration[5] - turn[1]).abs() < 0.6, "{}", found.acceleration[5]);
            assert!((found.acceleration[2] - shift[1]).abs() < 0.6, "{}", found.acceleration[2]);
            assert!((found.jerk[5] + 0.05 * 15625.0 * phase.cos()).abs() < 60.0, "{}", found.jerk[5]);
        }
    }

    #[test]
    fn an_exposure_that_was_mistaken_is_overruled_by_its_neighbours() {
        let mut sightings = shake(20);
        let truth = sightings[10].unwrap().velocity.unwrap();
        let mistaken = truth + Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        sightings[10].as_mut().unwrap().velocity = Some(mistaken);
        let found = Motions::of(&sightings, &camera(), 2.0, DT).around(10).unwrap().velocity;
        assert!((found - truth).norm() < 0.5 * (mistaken - truth).norm(), "{found}");
    }

    #[test]
    fn noise_makes_what_is_believed_less_certain() {
        let sightings = shake(30);
        let sure = Motions::of(&sightings, &camera(), 2.0, DT).around(15).unwrap();
        let mut noisy = sightings;
        for (k, sighting) in noisy.iter_mut().flatten().enumerate() {
            // Eight millimetres, two pixels, to and fro as no hand does.
            sighting.world_from_mid.translation.x += 0.008 * f64::from([1, -1, -1, 1, 1, -1, 1][k % 7]);
        }
        let unsure = Motions::of(&noisy, &camera(), 2.0, DT).around(15).unwrap();
        assert!(unsure.velocity_sigma[0] > 2.0 * sure.velocity_sigma[0]);
    }

    #[test]
    fn only_frames_that_are_near_tell() {
        let late = Sighting { time: 5.0, ..shaken(0.1) };
        let alone = [Some(shaken(0.0)), None, Some(late)];
        assert!((0..3).all(|k| Motions::of(&alone, &camera(), 2.0, DT).around(k).is_none()));
        let both = [Some(shaken(0.0)), Some(shaken(DT))];
        let found = Motions::of(&both, &camera(), 2.0, DT).around(0).unwrap();
        // The frame's own exposure says how fast it turned.
        assert!((found.velocity[5] - 1.25).abs() < 0.1, "{}", found.velocity[5]);
    }

    #[test]
    fn sharp_frames_have_no_velocity_but_their_places_do() {
        let still = |k: usize| Sighting { velocity: None, ..shaken(k as f64 * DT * 0.3) };
        let sightings: Vec<Option<Sighting>> = (0..12).map(|k| Some(still(k))).collect();
        let sightings: Vec<Option<Sighting>> = sightings
            .iter()
            .enumerate()
            .map(|(k, s)| s.map(|s| Sighting { time: k as f64 * DT, ..s }))
            .collect();
        let found = Motions::of(&sightings, &camera(), 2.0, DT).around(6).unwrap();
        let truth = 0.05 * 25.0 * 0.3 * (25.0 * 6.0 * DT * 0.3).cos();
        assert!((found.velocity[5] - truth).abs() < 0.02, "{} {truth}", found.velocity[5]);
    }
}
