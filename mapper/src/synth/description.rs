//! The texts beside a written sequence: calibration and README.

use std::fmt::Write as _;

use super::{CameraMotion, DepthSensor, Summary, SynthConfig, SynthSequence};

/// `calibration.toml` of the sequence.
pub(super) fn calibration(sequence: &SynthSequence) -> String {
    let camera = sequence.camera();
    let config = sequence.config();
    let mut text = String::new();
    let mut line = |key: &str, value: &dyn std::fmt::Display| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{key} = {value}");
    };
    line("width", &camera.width);
    line("height", &camera.height);
    line("fx", &format!("{:?}", camera.fx));
    line("fy", &format!("{:?}", camera.fy));
    line("cx", &format!("{:?}", camera.cx));
    line("cy", &format!("{:?}", camera.cy));
    line("depth_scale", &"5000.0");
    line("exposure_seconds", &format!("{:?}", config.exposure_seconds));
    line("frame_rate", &format!("{:?}", config.frame_rate));
    line("response", &format!("\"{}\"", config.response.name()));
    line("readout", &"\"global\"");
    text
}

/// `README.md`: the settings, and what each file holds.
pub(super) fn readme(sequence: &SynthSequence, summary: &Summary) -> String {
    let SynthConfig { scene, frames, width, height, frame_rate, seed, gain, .. } = sequence.config();
    let config = sequence.config();
    let noise = match config.noise {
        Some(noise) => format!("{} e- full well, {} e- read noise", noise.full_well, noise.read_noise),
        None => "none".to_owned(),
    };
    let way = match config.motion {
        CameraMotion::Sweep => "",
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
* gyro.csv: angular velocity in camera axes, rad/s, without noise or bias.
* Camera axes: x right, y down, z forward; world y is up. The centre of the top-left pixel is (0, 0).
",
        exposure = 1e3 * config.exposure_seconds,
        mean = summary.mean_blur_px,
        p95 = summary.largest_p95_px,
        response = config.response.name(),
        sub_frames = summary.most_sub_frames,
    )
}
