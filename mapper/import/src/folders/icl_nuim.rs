//! ICL-NUIM (Handa et al., ICRA 2014) in its layout for the TUM tools: `associations.txt` with numbers of frames in place
//! of times, `depth/`, `rgb/` and a trajectory `*.gt.freiburg`.

use std::path::{Path, PathBuf};

use mba_io::dataset::Shutter;
use mba_io::text_lines::TextFile;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::ImportError;
use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading, files};
use crate::picture::Picture;
use crate::time::Time;

pub(crate) const FORMAT: Format = Format {
    name: "ICL-NUIM",
    looked_for: "associations.txt and *.gt.freiburg",
    recognise: |path| path.join(LIST).is_file() && truth(path).is_some(),
    read,
};

const LIST: &str = "associations.txt";

/// Frames per second that are rendered.
const FRAME_RATE: f64 = 30.0;

/// The camera of all sequences. Its vertical focal length is negative in the files: there the y axis points up.
const CAMERA: PinholeCamera =
    PinholeCamera { width: 640, height: 480, fx: 481.2, fy: 480.0, cx: 319.5, cy: 239.5 };

fn truth(folder: &Path) -> Option<PathBuf> {
    files(folder, "", &[".gt.freiburg"]).ok()?.into_iter().next()
}

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    const EXPECTED: &str = "number image number image";
    let folder = reading.path;
    let list = TextFile::read(&folder.join(LIST))?;
    let lines: Vec<_> = list.lines().collect();
    reading.each(&lines, |line| {
        let fields: Vec<&str> = line.fields().collect();
        let &[number, first, _, second] = fields.as_slice() else {
            return Err(line.malformed(EXPECTED).into());
        };
        let time = Time::from_seconds(line.number(number, EXPECTED)? / FRAME_RATE)
            .ok_or_else(|| line.malformed(EXPECTED))?;
        // Some lists name colour first, others depth.
        let is_depth = |name: &str| name.trim_start_matches("./").starts_with("depth");
        let (depth, colour) = if is_depth(first) { (first, second) } else { (second, first) };
        let (colour, depth) = (folder.join(colour), folder.join(depth));
        destination.add_colour(time, &Picture::File(colour.clone()), &colour)?;
        destination.add_depth(time, &Picture::File(depth.clone()), &depth)?;
        Ok(())
    })?;
    if let Some(path) = truth(folder) {
        read_truth(&path, destination)?;
    }
    // 5000 units per metre; rendered, so that all rows are of one moment.
    let mut facts = Facts::new(CAMERA, 5000.0);
    facts.frame_rate = Some(FRAME_RATE);
    facts.readout = Some(Shutter::Global);
    Ok(facts)
}

/// Lines `number tx ty tz qx qy qz qw` in a world and of a camera whose y axes point up: both are mirrored.
fn read_truth(path: &Path, destination: &mut Destination) -> Result<(), ImportError> {
    let file = TextFile::read(path)?;
    for line in file.lines() {
        let expected = "number tx ty tz qx qy qz qw";
        let [number, x, y, z, qx, qy, qz, qw] = line.numbers(expected)?;
        let time = Time::from_seconds(number / FRAME_RATE).ok_or_else(|| line.malformed(expected))?;
        // Mirroring turns the axis of a rotation and its sense: x and z of the quaternion change their sign.
        let quaternion = Quaternion::new(qw, -qx, qy, -qz);
        if (quaternion.norm() - 1.0).abs() > 1e-2 {
            return Err(line.malformed(expected).into());
        }
        let rotation = UnitQuaternion::new_normalize(quaternion);
        destination.poses.push((time, RigidTransform::new(rotation, Vector3::new(x, -y, z))));
    }
    Ok(())
}
