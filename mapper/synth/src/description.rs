//! The texts beside a written sequence: calibration, exposure times and README.

use std::fmt::Write as _;

use mba_io::dataset::{Vignetting, response_text};
use nalgebra::Vector3;

use super::{
    CameraMotion, DepthSensor, ResponseCurve, SensorModel, SynthConfig, SynthSequence, SynthSummary, inertial,
};

/// Folder in a data set for what its calibration does not say.
pub(super) const TRUTH_FOLDER: &str = "truth";

/// `calibration.toml` with all there is to know of the camera.
pub(super) fn calibration(sequence: &SynthSequence) -> String {
    let mut text = geometry(sequence);
    let config = sequence.config();
    let SensorModel { readout_seconds, depth_readout_seconds, vignetting: Vignetting { a2, a4 }, .. } =
        config.sensor;
    let mut line = |key: &str, value: &dyn std::fmt::Display| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{key} = {value}");
    };
    line("exposure_seconds", &format!("{:?}", config.exposure_seconds));
    line("frame_rate", &format!("{:?}", config.frame_rate));
    line("response", &format!("\"{}\"", config.response.name()));
    if readout_seconds == 0.0 {
        line("readout", &"\"global\"");
    } else {
        line("readout", &"\"rolling\"");
        line("readout_seconds", &format!("{readout_seconds:?}"));
    }
    if depth_readout_seconds != 0.0 {
        line("depth_readout_seconds", &format!("{depth_readout_seconds:?}"));
    }
    if !config.sensor.vignetting.is_none() {
        line("vignetting", &format!("[{a2:?}, {a4:?}]"));
    }
    text
}

/// `calibration.toml` of a camera that tells nothing of its times and light.
pub(super) fn bare_calibration(sequence: &SynthSequence) -> String {
    let mut text = geometry(sequence);
    let config = sequence.config();
    let _ = writeln!(text, "frame_rate = {:?}", config.frame_rate);
    if config.sensor.readout_seconds != 0.0 {
        text.push_str("readout = \"rolling\"\n");
    }
    text
}

/// Size, intrinsics and depth scale.
fn geometry(sequence: &SynthSequence) -> String {
    let camera = sequence.camera();
    let mut text = format!("width = {}\nheight = {}\n", camera.width, camera.height);
    for (key, value) in [("fx", camera.fx), ("fy", camera.fy), ("cx", camera.cx), ("cy", camera.cy)] {
        let _ = writeln!(text, "{key} = {value:?}");
    }
    text.push_str("depth_scale = 5000.0\n");
    text
}

/// `exposures.csv`.
pub(super) fn exposures(sequence: &SynthSequence) -> String {
    let row = |index: usize| {
        let (time, exposure) = (sequence.timestamp(index), sequence.exposure_seconds(index));
        format!("{index},{time:.6},{exposure:.6}\n")
    };
    let rows: String = (0..sequence.len()).map(row).collect();
    format!("frame,timestamp,exposure_s\n{rows}")
}

/// Name and text of the file that a calibration with a measured response needs.
pub(super) fn response_table(response: &ResponseCurve) -> Option<(&'static str, String)> {
    match response {
        ResponseCurve::Srgb | ResponseCurve::Linear => None,
        ResponseCurve::Measured(inverse) => Some((response.name(), response_text(inverse))),
    }
}

/// `README.md`: the settings, and what each file holds.
pub(super) fn readme(sequence: &SynthSequence, summary: &SynthSummary) -> String {
    let SynthConfig { scene, frames, width, height, frame_rate, seed, gain, .. } = sequence.config();
    let config = sequence.config();
    // Words for what the settings are numbers of.
    let noise = match config.noise {
        Some(noise) => format!("{} e- full well, {} e- read noise", noise.full_well, noise.read_noise),
        None => "none".to_owned(),
    };
    let way = match config.motion {
        CameraMotion::Sweep => "",
        CameraMotion::Walk => "The camera walks through a row of rooms, with a round in each.\n",
        CameraMotion::Loop => {
            "The camera goes once round the scene; it ends near the place and heading of its start.\n"
        }
    };
    let depth = match config.depth {
        DepthSensor::Exact => "exact",
        DepthSensor::StructuredLight => {
            "structured light: sigma 0.0019 z^2 m, whole millimetres, holes at edges and grazing angles"
        }
    };
    format!(
        "# Synthetic sequence: {scene}

{frames} frames of {width}x{height} pixels at {frame_rate} Hz, exposure {exposure:.3} ms, seed {seed}.
{way}Blur from shutter opening to closing: mean {mean:.2} px, largest 95th percentile of a frame {p95:.2} px.
Response {response}, gain {gain}, image noise: {noise}. Depth: {depth}.

* rgb/: mean of 16 to {sub_frames} sub-frames over the exposure (number in blur.csv) in linear light, then gain,
  noise, response, 8 bit.
* sharp/: the view at mid exposure without blur and noise, same gain and response.
* heldout_views/: sharp views without noise from poses.txt (camera-to-world), between the frames and a little
  beside the camera's path; image NNNNNN is line NNNNNN of the poses, counted from zero.
* surface_points.ply: points of the true surface that frames see, about 1 cm apart, world.
* depth/: along the optical axis at mid exposure, 16 bit, 5000 units per metre, 0 = missing.
* groundtruth.txt: camera-to-world at mid exposure; groundtruth_exposure.txt: at opening, mid exposure, closing.
  Between them the camera moves on a smooth path that is not exactly linear.
{sensor}* Camera axes: x right, y down, z forward; world y is up. The centre of the top-left pixel is (0, 0).
",
        exposure = 1e3 * config.exposure_seconds,
        mean = summary.mean_blur_px,
        p95 = summary.largest_p95_px,
        response = config.response.name(),
        sub_frames = summary.most_sub_frames,
        sensor = sensor_notes(sequence),
    )
}

/// What differs from an ideal camera and an undisturbed walk, a line for each.
fn sensor_notes(sequence: &SynthSequence) -> String {
    let config = sequence.config();
    let SensorModel {
        readout_seconds,
        depth_delay_seconds,
        depth_readout_seconds,
        auto_exposure,
        vignetting,
        imu,
        is_on_record,
    } = config.sensor;
    let events = &config.events;
    let mut notes = Vec::new();
    // What is ideal is not mentioned.
    if readout_seconds != 0.0 {
        notes.push(format!(
            "Rolling shutter: row v is exposed around the timestamp plus ((v + 1/2)/{} - 1/2) * {readout_seconds} s. \
             Ground truth, blur.csv and sharp/ are those of the middle of the image, sharp/ with all rows together.",
            config.height
        ));
    }
    if depth_delay_seconds != 0.0 {
        notes.push(format!(
            "Depth is measured {depth_delay_seconds} s after the colour timestamp; depth.txt and associations.txt have \
             its own timestamps."
        ));
    }
    if depth_readout_seconds != 0.0 {
        notes.push(format!(
            "Row v of depth is measured ((v + 1/2)/{} - 1/2) * {depth_readout_seconds} s after its timestamp.",
            config.height
        ));
    }
    if auto_exposure {
        notes.push(
            "Auto exposure: each time follows the brightness of the frame before (blur.csv). The gain stays, so a longer \
             exposure is a brighter picture, in rgb/ and sharp/; heldout_views/ have the exposure above."
                .to_owned(),
        );
    }
    if !vignetting.is_none() {
        notes.push(format!(
            "Light falls off as 1 + {:?} r^2 + {:?} r^4, r = 1 in the corner, in rgb/, sharp/ and heldout_views/.",
            vignetting.a2, vignetting.a4
        ));
    }
    if imu {
        let [rate, force] = inertial::biases(config.seed)
            .map(|bias: Vector3<f64>| format!("{:.6} {:.6} {:.6}", bias.x, bias.y, bias.z));
        notes.push(format!(
            "imu.csv: 200 Hz, angular velocity and specific force (9.80665 m/s^2 upward at rest) in camera axes, with \
             constant biases ({rate} rad/s; {force} m/s^2) and noise (0.002 rad/s, 0.02 m/s^2 per sample)."
        ));
    }
    if !is_on_record {
        notes.push(format!(
            "NOT on record, to be estimated: exposure times, readout time, response, fall-off. {}/ has them, for judging \
             only.",
            TRUTH_FOLDER
        ));
    }
    if !(events.black.is_empty() && events.saturated.is_empty()) {
        notes.push(format!(
            "Frames without a view: black {}, saturated {}; they have no depth. sharp/ shows what was there.",
            events.black, events.saturated
        ));
    }
    if let Some(jump) = events.jump {
        notes.push(format!("From frame {jump} on the camera goes again where it went from frame 0 on."));
    }
    notes.into_iter().map(|note| format!("* {note}\n")).collect()
}
