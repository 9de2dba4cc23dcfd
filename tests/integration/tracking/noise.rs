//! Nonsense from fixed seeds: whatever comes in, poses stay finite and nothing panics.

use mba_tests::handheld::{camera_of_width, tracker_config, workspace};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::image::{ColourView, DepthView, PixelFormat, PixelRectangle};
use mba_tracker::{Frame, ReferenceMode, ReferenceView, SimdLevel, Tracker, TrackerConfig};
use nalgebra::Vector3;

use crate::scenes::SMALL;

/// Images between pure noise, flat patches and sense.
fn nonsense(draw: &mut Uniform, width: usize, height: usize) -> (Vec<u8>, Vec<u16>) {
    let amplitude = draw.within(0.0, 256.0);
    let base = draw.within(0.0, 256.0);
    let grey = (0..width * height).map(|_| (base + draw.within(-amplitude, amplitude)) as u8).collect();
    let (near, far) = (draw.within(0.0, 3000.0), draw.within(0.0, 65_536.0));
    let holes = draw.within(0.0, 1.0);
    let depth =
        (0..width * height)
            .map(|_| {
                if draw.within(0.0, 1.0) < holes {
                    0
                } else {
                    draw.within(near.min(far), near.max(far)) as u16
                }
            })
            .collect();
    (grey, depth)
}

fn random_vector(draw: &mut Uniform, bound: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| draw.within(-bound, bound))
}

fn random_config(draw: &mut Uniform) -> TrackerConfig {
    let mut config = tracker_config(camera_of_width(draw.within(64.0, 200.0) as usize));
    config.align.depth_term = draw.within(0.0, 1.0) < 0.7;
    config.align.blur = draw.within(0.0, 1.0) < 0.8;
    config.align.max_views = draw.within(0.0, 40.0) as usize;
    config.reference =
        if draw.within(0.0, 1.0) < 0.8 { ReferenceMode::Deblurred } else { ReferenceMode::Raw };
    let (w, h) = (config.camera.width as f64, config.camera.height as f64);
    if draw.within(0.0, 1.0) < 0.3 {
        config.region = PixelRectangle {
            left: draw.within(0.0, w) as usize,
            top: draw.within(0.0, h) as usize,
            right: draw.within(0.0, w) as usize,
            bottom: draw.within(0.0, h) as usize,
        };
    }
    config
}

#[test]
fn nonsense_never_panics() {
    for seed in 0..40 {
        let mut draw = Uniform::new(seed);
        let config = random_config(&mut draw);
        let (width, height) = (config.camera.width, config.camera.height);
        let mut memory = workspace(&config);
        let mut tracker =
            Tracker::new(&config, SimdLevel::new(), &mut memory).expect("a valid configuration");
        let mut timestamp = draw.within(-1e6, 1e6);
        for _ in 0..12 {
            let (grey, raw) = nonsense(&mut draw, width, height);
            let colour = ColourView::new(&grey, width, height, width, PixelFormat::Grey8).expect("a view");
            let depth = DepthView::new(&raw, width, height, width).expect("a view");
            timestamp += draw.within(1e-9, 0.3);
            if draw.within(0.0, 1.0) < 0.2 {
                let pose = RigidTransform::new(
                    so3::exp(&random_vector(&mut draw, 3.0)),
                    random_vector(&mut draw, 100.0),
                );
                let view = ReferenceView { colour, depth, world_from_camera: pose };
                tracker.set_reference(&view).expect("a valid view");
            }
            let gyro = match draw.within(0.0, 4.0) as usize {
                0 => Some(random_vector(&mut draw, 1000.0)),
                1 => Some(Vector3::new(f64::NAN, f64::INFINITY, 0.0)),
                _ => None,
            };
            let exposure = draw.within(0.0, 0.5);
            let frame = Frame {
                timestamp,
                exposure,
                depth_timestamp: timestamp,
                colour,
                depth,
                angular_velocity: gyro,
                gyro: None,
                expected_path: None,
            };
            let result = tracker.track(&frame).expect("a valid frame");
            let path = result.world_from_camera;
            assert!(path.start.is_valid() && path.end.is_valid(), "seed {seed}: {path:?}");
        }
    }
}

#[test]
fn a_gyroscope_that_fails_does_not_matter() {
    let config = tracker_config(camera_of_width(160));
    let mut memory = workspace(&config);
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory).expect("memory");
    for (k, frame) in SMALL[..6].iter().enumerate() {
        let mut view = frame.view();
        let nonsense = if k % 2 == 0 { f64::NAN } else { 1e6 };
        view.angular_velocity = Some(Vector3::repeat(nonsense));
        let result = tracker.track(&view).expect("a valid frame");
        let (metres, _) = mba_tests::handheld::pose_error(&result, frame, &SMALL[0]);
        assert!(metres < 0.002, "frame {k}: {:?}, {metres} m", result.status);
    }
}
