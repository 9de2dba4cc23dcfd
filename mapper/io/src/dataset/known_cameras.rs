//! Calibrations of well-known sequences that come without a calibration file.

use std::ops::Range;
use std::path::Path;

use mba_tracker::geometry::{Distortion, PinholeCamera};

/// Published calibration of one camera.
pub(super) struct KnownCamera {
    /// Name for people.
    pub(super) name: &'static str,
    pub(super) camera: PinholeCamera,
    pub(super) distortion: Distortion,
}

/// Raw depth units per metre in the TUM RGB-D benchmark.
pub(super) const TUM_DEPTH_SCALE: f64 = 5000.0;

/// Frames per second of the TUM RGB-D benchmark.
pub(super) const TUM_FRAME_RATE: f64 = 30.0;

/// When the benchmark was recorded, seconds since 1970: 2011 and 2012.
const RECORDED: Range<f64> = 1.29e9..1.36e9;

/// Colour camera of a TUM RGB-D sequence (Sturm et al., IROS 2012), recognised by `freiburg1` (or `fr1`) and so
/// on in the folder's name, and by the time of its first frame, seconds since 1970: others name folders like that, too.
pub(super) fn tum_camera(folder: &Path, first: f64) -> Option<KnownCamera> {
    if !RECORDED.contains(&first) {
        return None;
    }
    let name = folder.file_name()?.to_string_lossy().to_lowercase();
    let words: Vec<&str> = name.split(|c: char| !c.is_alphanumeric()).collect();
    let named = |number: u32| {
        name.contains(&format!("freiburg{number}")) || words.contains(&format!("fr{number}").as_str())
    };
    (1..=3).find(|number| named(*number)).map(freiburg)
}

/// When the sequences of Bonn were recorded, seconds since 1970: 2018 and 2019.
const RECORDED_IN_BONN: Range<f64> = 1.51e9..1.58e9;

/// Camera of the Bonn RGB-D dynamic dataset (Palazzolo et al., IROS 2019), recognised as [`tum_camera`] is.
pub(super) fn bonn_camera(folder: &Path, first: f64) -> Option<KnownCamera> {
    let is_bonn = folder.file_name()?.to_string_lossy().to_lowercase().contains("rgbd_bonn");
    (is_bonn && RECORDED_IN_BONN.contains(&first)).then(|| KnownCamera {
        name: "the Bonn RGB-D dynamic dataset",
        camera: PinholeCamera {
            width: 640,
            height: 480,
            fx: 542.822_841,
            fy: 542.576_870,
            cx: 315.593_520,
            cy: 237.756_098,
        },
        distortion: Distortion { k1: 0.039_903, k2: -0.099_343, p1: -0.000_730, p2: -0.000_144, k3: 0.0 },
    })
}

fn freiburg(number: u32) -> KnownCamera {
    let (name, [fx, fy, cx, cy], [k1, k2, p1, p2, k3]) = match number {
        1 => (
            "TUM freiburg1",
            [517.306408, 516.469215, 318.643040, 255.313989],
            [0.262383, -0.953104, -0.005358, 0.002628, 1.163314],
        ),
        2 => (
            "TUM freiburg2",
            [520.908620, 521.007327, 325.141442, 249.701764],
            [0.231222, -0.784899, -0.003257, -0.000105, 0.917205],
        ),
        // The images of this camera are published already rectified.
        _ => ("TUM freiburg3", [535.433105, 539.212524, 320.106653, 247.632132], [0.0; 5]),
    };
    KnownCamera {
        name,
        camera: PinholeCamera { width: 640, height: 480, fx, fy, cx, cy },
        distortion: Distortion { k1, k2, p1, p2, k3 },
    }
}
