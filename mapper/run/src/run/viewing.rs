//! The map of a run as viewers of splats show it best.

use mba_io::trajectory_file::TimedExposure;
use mba_map::viewer_splats::{ViewerSplats, viewer_splats};
use mba_raster::gaussians::{ForViewers, Gaussians};
use mba_tracker::SimdLevel;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::photometric::InverseResponse;
use nalgebra::Vector3;

use super::orientation::{start_view, up_direction};
use super::{FrameRecord, FrameStatus, Upright};

/// The first line of the header after the format.
const TITLE: &str =
    "mba: f_dc and scale are for viewers, which blend display values; mba_dc and mba_scale are the map";

/// Colours and sizes for viewers, fitted to the keyframes of a run, and comments that say which way is up and where to start.
///
/// The map is rendered with the instructions `simd`; `camera` and `response` are those of the run, `upright` is what it knows of up, and `exposures` and `frames` are its rows.
#[must_use]
pub fn for_viewers(
    simd: SimdLevel,
    map: &Gaussians,
    camera: PinholeCamera,
    response: &InverseResponse,
    upright: Option<&Upright>,
    (exposures, frames): (&[TimedExposure], &[FrameRecord]),
) -> ForViewers {
    let poses = |all: bool| -> Vec<RigidTransform> {
        let rows = exposures.iter().zip(frames);
        let used =
            rows.filter(|(_, frame)| frame.status != FrameStatus::Lost && (all || frame.keyframe != 0));
        used.map(|(exposure, _)| exposure.mid).collect()
    };
    let keyframes = poses(false);
    let poses = if keyframes.is_empty() { poses(true) } else { keyframes };
    let ViewerSplats { colours, log_scales } = viewer_splats(map, camera, &poses, response, simd);
    let comments = comments(&up_direction(upright, exposures, frames), start_view(exposures, frames));
    ForViewers { colours, log_scales, comments }
}

/// Whether a file that begins with `start` is a map for viewers that this program wrote.
#[must_use]
pub fn is_own_splats(start: &[u8]) -> bool {
    start.starts_with(format!("ply\nformat binary_little_endian 1.0\ncomment {TITLE}\n").as_bytes())
}

fn comments(up: &Vector3<f64>, start: Option<RigidTransform>) -> Vec<String> {
    let mut comments = vec![TITLE.to_owned()];
    comments.extend(vertical_axis(up).map(|axis| format!("Vertical axis: {axis}")));
    comments.push(format!("up {:.6} {:.6} {:.6}", up.x, up.y, up.z));
    comments.extend(start.map(|pose| {
        let (p, q) = (pose.translation, pose.rotation);
        format!(
            "start view, camera-to-world tx ty tz qx qy qz qw: {:.6} {:.6} {:.6} {:.6} {:.6} {:.6} {:.6}",
            p.x, p.y, p.z, q.i, q.j, q.k, q.w
        )
    }));
    comments
}

/// The name of the axis nearest to the vertical, as the viewer brush reads it: up is x, or against y or z. None for other
/// directions.
fn vertical_axis(up: &Vector3<f64>) -> Option<char> {
    let largest = up.iamax();
    let name = ['x', 'y', 'z'][largest];
    ((up[largest] > 0.0) == (name == 'x')).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_tells_up_and_the_start() {
        let up = Vector3::new(0.1, -0.99, 0.05);
        let pose = RigidTransform { translation: Vector3::new(1.0, 2.0, 3.0), ..Default::default() };
        let lines = comments(&up, Some(pose));
        assert_eq!(lines[1..3], ["Vertical axis: y", "up 0.100000 -0.990000 0.050000"]);
        assert!(lines[3].ends_with("qw: 1.000000 2.000000 3.000000 0.000000 0.000000 0.000000 1.000000"));
        assert_eq!(
            [vertical_axis(&-up), vertical_axis(&Vector3::z()), vertical_axis(&Vector3::x())],
            [None, None, Some('x')]
        );
        assert_eq!(comments(&Vector3::y(), None).len(), 2);
    }
}
