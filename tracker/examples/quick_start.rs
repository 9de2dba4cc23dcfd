//! Tracks ten blurred frames. The world is the first frame's camera at mid exposure.
//!
//! `cargo run --release -p mba-tracker --example quick_start`

mod room;

use std::error::Error;

use mba_tracker::photometric::InverseResponse;
use mba_tracker::{Frame, FrameStatus, SimdLevel, Tracker, TrackerConfig};
use room::{CAMERA, EXPOSURE, METRES_PER_UNIT};

fn main() -> Result<(), Box<dyn Error>> {
    let config = TrackerConfig::new(CAMERA, METRES_PER_UNIT, InverseResponse::linear());
    let mut memory = vec![0; config.workspace_len()];
    let mut tracker = Tracker::new(&config, SimdLevel::new(), &mut memory)?;

    for k in 0..10 {
        let timestamp = f64::from(k) / 30.0;
        let picture = room::photograph(&room::exposure(timestamp));
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
        let result = tracker.track(&frame)?;

        let [opened, closed] = [result.world_from_camera.start, result.world_from_camera.end]
            .map(|pose| pose.translation.map(|metres| format!("{metres:7.4}")));
        println!(
            "{k} {:4} blur {:4.1} px, opened at {} {} {}, closed at {} {} {}",
            result.status.name(),
            result.blur,
            opened.x,
            opened.y,
            opened.z,
            closed.x,
            closed.y,
            closed.z
        );
        if result.status == FrameStatus::Lost {
            return Err("lost".into());
        }
    }
    Ok(())
}
