//! Tracks against sharp views from a map: poses are then in the map's frame, and do not drift.
//!
//! Here the map is the room itself. The camera starts anywhere in it; where that is, the first view says.
//!
//! `cargo run --release -p mba-tracker --example external_reference`

mod room;

use std::error::Error;

use mba_tracker::geometry::RigidTransform;
use mba_tracker::photometric::InverseResponse;
use mba_tracker::trajectory::ExposureTrajectory;
use mba_tracker::{Frame, ReferenceView, SimdLevel, Tracker, TrackerConfig};
use nalgebra::Vector6;
use room::{CAMERA, EXPOSURE, METRES_PER_UNIT};

/// Renders the map at a pose and hands the view to the tracker.
fn show_map(tracker: &mut Tracker, map_from_view: RigidTransform) -> Result<(), Box<dyn Error>> {
    let rendered = room::photograph(&ExposureTrajectory::still(map_from_view));
    let (colour, depth) = rendered.views()?;
    tracker.set_reference(&ReferenceView { colour, depth, world_from_camera: map_from_view })?;
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let config = TrackerConfig::new(CAMERA, METRES_PER_UNIT, InverseResponse::linear());
    let mut memory = vec![0; config.workspace_len()];
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory)?;

    // About where the camera is: a few centimetres aside, a degree off.
    let aside = Vector6::new(0.03, -0.02, 0.03, 0.01, -0.02, 0.01);
    show_map(&mut tracker, room::exposure(0.0).mid().perturbed(&aside))?;

    let mut worst = 0.0f64;
    for k in 0..10 {
        let timestamp = f64::from(k) / 30.0;
        let truth = room::exposure(timestamp);
        let picture = room::photograph(&truth);
        let (colour, depth) = picture.views()?;
        let frame = Frame {
            timestamp,
            exposure: EXPOSURE,
            depth_timestamp: timestamp,
            colour,
            depth,
            angular_velocity: None,
            gyro: None,
            expected_path: None,
        };
        let map_from_camera = tracker.track(&frame)?.world_from_camera;

        let millimetres = 1000.0 * (map_from_camera.mid().translation - truth.mid().translation).norm();
        let [opened, closed] = [map_from_camera.start, map_from_camera.end]
            .map(|pose| pose.translation.map(|metres| format!("{metres:.4}")));
        println!(
            "{k} opened at {} {} {}, closed at {} {} {} in the map; middle off by {millimetres:.2} mm",
            opened.x, opened.y, opened.z, closed.x, closed.y, closed.z
        );
        worst = worst.max(millimetres);
        if k % 5 == 4 {
            show_map(&mut tracker, map_from_camera.mid())?;
        }
    }
    if worst > 1.0 {
        return Err(format!("largest position error {worst:.2} mm").into());
    }
    Ok(())
}
