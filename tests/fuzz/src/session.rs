//! A session of the tracker: any valid configuration, any frames, in any order of calls.

use mba_tracker::geometry::{PinholeCamera, RigidTransform, so3};
use mba_tracker::image::{ColourView, DepthView, PixelFormat, PixelRectangle};
use mba_tracker::photometric::InverseResponse;
use mba_tracker::simd::{Level, levels_up_to};
use mba_tracker::{
    Effort, ExpectedPath, Frame, GyroReading, ReferenceMode, ReferenceView, Tracker, TrackerConfig,
};
use nalgebra::{Vector3, Vector6};

use super::numbers::Numbers;
use super::picture::Picture;

/// Calls of one session.
const MOST_CALLS: usize = 12;

/// A configuration and the calls that follow.
pub fn session(data: &[u8]) {
    let mut numbers = Numbers::new(data);
    let config = configuration(&mut numbers);
    let levels = levels_up_to(Level::new());
    let level = levels[numbers.below(levels.len())];
    if config.validate().is_err() {
        // Nothing may be computed from it, but nothing may fail either.
        assert!(Tracker::new(&config, level, &mut []).is_err());
        return;
    }
    let mut memory = vec![0xA5; config.workspace_len()];
    let mut tracker = Tracker::new(&config, level, &mut memory).expect("valid, and enough memory");
    let mut time = 0.0;
    for _ in 0..MOST_CALLS {
        if numbers.is_empty() {
            break;
        }
        call(&mut tracker, &config, &mut time, &mut numbers);
    }
}

fn configuration(numbers: &mut Numbers<'_>) -> TrackerConfig {
    let [width, height] = [0, 1].map(|_| 32 + numbers.below(64));
    let [width, height] = if numbers.rarely(32) { [height, numbers.u32() as usize] } else { [width, height] };
    let focal = [0, 1].map(|_| numbers.near(0.9 * width.min(100) as f64, 20.0));
    let [cx, cy] = [width, height].map(|length| numbers.near(0.5 * length.min(100) as f64 - 0.5, 5.0));
    let camera = PinholeCamera { width, height, fx: focal[0], fy: focal[1], cx, cy };
    let metres_per_unit = numbers.near(0.001, 0.0005) as f32;
    let response = if numbers.rarely(2) { InverseResponse::srgb() } else { InverseResponse::linear() };
    let mut config = match numbers.below(3) {
        0 => TrackerConfig::compact(camera, metres_per_unit, response),
        _ => TrackerConfig::new(camera, metres_per_unit, response),
    };
    let choices = numbers.byte();
    if choices & 1 != 0 {
        config.levels = numbers.below(8);
        config.surface_level = numbers.below(4);
    }
    if choices & 2 != 0 {
        config.readout.colour = numbers.near(0.0, 0.05);
        config.readout.depth = numbers.near(0.0, 0.05);
        config.readout.bands = numbers.below(18);
        config.readout.depth_apart = numbers.rarely(2);
    }
    if choices & 4 != 0 {
        config.recent_keyframes = numbers.below(6);
        config.deblur_iterations = numbers.below(6);
    }
    if choices & 8 != 0 {
        config.reference = ReferenceMode::Raw;
    }
    if choices & 16 != 0 {
        let [left, top, right, bottom] = [0; 4].map(|_| numbers.below(110));
        config.region = PixelRectangle { left, top, right, bottom };
    }
    match numbers.below(4) {
        0 => config.with_effort(Effort::Low),
        1 => config.with_effort(Effort::Medium),
        _ => config,
    }
}

fn expected_path(numbers: &mut Numbers<'_>) -> ExpectedPath {
    let mut derivative = |spread: f64| Vector6::from_fn(|_, _| numbers.near(0.0, spread));
    let (velocity, acceleration, jerk) = (derivative(1.0), derivative(10.0), derivative(100.0));
    let mut sigmas = |spread: f64| [0, 1].map(|_| numbers.near(spread, spread));
    ExpectedPath {
        velocity,
        acceleration,
        jerk,
        velocity_sigma: sigmas(0.1),
        acceleration_sigma: sigmas(3.0),
    }
}

fn call(tracker: &mut Tracker<'_>, config: &TrackerConfig, time: &mut f64, numbers: &mut Numbers<'_>) {
    let (width, height) = (config.camera.width, config.camera.height);
    let what = numbers.below(20);
    let picture = Picture::new(width, height, numbers);
    let colour = ColourView::new(&picture.grey, width, height, width, PixelFormat::Grey8).expect("all rows");
    let depth = DepthView::new(&picture.depth, width, height, width).expect("all rows");
    match what {
        16 => {
            let view = ReferenceView { colour, depth, world_from_camera: pose(numbers) };
            let _ = tracker.set_reference(&view);
        }
        17 => {
            let view = ReferenceView { colour, depth, world_from_camera: pose(numbers) };
            let _ = tracker.relocate(&view, &pose(numbers));
        }
        18 => drop(tracker.move_world(&pose(numbers))),
        19 => {
            tracker.reset();
            *time = 0.0;
        }
        _ => {
            *time += numbers.near(0.0334, 0.033);
            let frame = Frame {
                timestamp: *time,
                exposure: numbers.near(0.016, 0.016),
                depth_timestamp: *time + numbers.near(0.0, 0.05),
                colour,
                depth,
                angular_velocity: numbers.rarely(4).then(|| vector(numbers)),
                gyro: numbers.rarely(4).then(|| GyroReading {
                    angular_velocity: vector(numbers),
                    angular_acceleration: vector(numbers),
                }),
                expected_path: numbers.rarely(4).then(|| expected_path(numbers)),
            };
            let Ok(result) = tracker.track(&frame) else {
                *time = frame.timestamp.clamp(-1e6, 1e6);
                return;
            };
            let poses = result.world_from_camera;
            assert!(poses.start.is_valid() && poses.end.is_valid(), "{result:?}");
            assert!((0.0..=1.0).contains(&result.inliers), "{result:?}");
        }
    }
}

fn vector(numbers: &mut Numbers<'_>) -> Vector3<f64> {
    Vector3::from_fn(|_, _| numbers.near(0.0, 2.0))
}

fn pose(numbers: &mut Numbers<'_>) -> RigidTransform {
    let rotation = so3::exp(&(0.1 * vector(numbers)));
    RigidTransform::new(rotation, 0.1 * vector(numbers))
}
