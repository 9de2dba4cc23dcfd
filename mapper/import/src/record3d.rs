//! Record3D: files `.r3d`, which are ZIP archives, or the folder that one is unpacked to. `metadata` is JSON, `rgbd/0.jpg`
//! colour, `rgbd/0.depth` metres and `rgbd/0.conf` confidence, both compressed by LZFSE.

use std::fs::{self, File};
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use lzfse_rust::LzfseRingDecoder;
use mba_io::dataset::check_camera;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use serde::Deserialize;
use zip::ZipArchive;

use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading};
use crate::picture::{MOST_PIXELS, Picture, UNITS_OF_METRES, grey_png, metres_png, one_line};
use crate::time::Time;
use crate::{ImportError, pose};

pub(crate) const FORMAT: Format = Format {
    name: "Record3D",
    looked_for: "an .r3d file, or metadata and rgbd/",
    recognise: |path| {
        let is_archive =
            path.is_file() && path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("r3d"));
        is_archive || (path.join("metadata").is_file() && path.join("rgbd").is_dir())
    },
    read,
};

/// Bytes of the largest file in an archive, as it is and inflated.
const LARGEST_PART: u64 = 256 << 20;

/// What is read of `metadata`.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Metadata {
    /// Size of colour.
    w: usize,
    h: usize,
    /// Size of depth, which older files do not have.
    dw: Option<usize>,
    dh: Option<usize>,
    /// Column by column.
    #[serde(rename = "K")]
    matrix: [f64; 9],
    fps: Option<f64>,
    /// Quaternion x y z w and place of the camera, as ARKit has them.
    #[serde(default)]
    poses: Vec<[f64; 7]>,
    /// Seconds.
    #[serde(default)]
    frame_timestamps: Vec<f64>,
}

/// Where the parts of a recording are.
enum Parts {
    Archive(Box<ZipArchive<BufReader<File>>>),
    Folder(PathBuf),
}

impl Parts {
    fn open(path: &Path) -> Result<Self, ImportError> {
        if path.is_dir() {
            return Ok(Self::Folder(path.to_owned()));
        }
        let file = File::open(path).map_err(|reason| ImportError::unreadable(path, reason))?;
        let archive = ZipArchive::new(BufReader::new(file));
        archive
            .map(|archive| Self::Archive(Box::new(archive)))
            .map_err(|error| ImportError::damaged(path, one_line(&error)))
    }

    /// The content of a part; none if it is not there.
    fn read(&mut self, name: &str) -> io::Result<Option<Vec<u8>>> {
        let mut bytes = Vec::new();
        let read = match self {
            Self::Archive(archive) => match archive.by_name(name) {
                Ok(part) => part.take(LARGEST_PART + 1).read_to_end(&mut bytes)?,
                Err(zip::result::ZipError::FileNotFound) => return Ok(None),
                Err(error) => return Err(io::Error::other(error)),
            },
            Self::Folder(folder) => {
                let path = folder.join(name);
                if !path.is_file() {
                    return Ok(None);
                }
                File::open(fs::canonicalize(path)?)?.take(LARGEST_PART + 1).read_to_end(&mut bytes)?
            }
        };
        if read as u64 > LARGEST_PART {
            return Err(io::Error::other(format!("it has more than the {LARGEST_PART} bytes that are read")));
        }
        Ok(Some(bytes))
    }
}

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let path = reading.path;
    let mut parts = Parts::open(path)?;
    let mut part = |name: &str| {
        parts.read(name).map_err(|error| ImportError::damaged(path, format!("{name}: {}", one_line(&error))))
    };
    let text = part("metadata")?.ok_or_else(|| ImportError::damaged(path, "it has no metadata"))?;
    let metadata: Metadata = serde_json::from_slice(&text)
        .map_err(|error| ImportError::damaged(path, format!("metadata: {error}")))?;
    let camera = camera(&metadata);
    check_camera(&camera).map_err(|invalid| ImportError::damaged(path, format!("metadata: {invalid}")))?;
    // Older files do not say the size of depth, which is then that of colour.
    let depth_size = (metadata.dw.unwrap_or(metadata.w), metadata.dh.unwrap_or(metadata.h));
    let all = metadata.frame_timestamps.len().max(metadata.poses.len());
    let mut beyond = 0;
    // Frames are numbered without gaps; the first that is missing is the end.
    for index in 0.. {
        let Some(jpeg) = part(&format!("rgbd/{index}.jpg"))? else { break };
        let depth_name = format!("rgbd/{index}.depth");
        let depth = part(&depth_name)?
            .ok_or_else(|| ImportError::damaged(path, format!("{depth_name} is missing")))?;
        let damaged = |reason: String| ImportError::damaged(path, format!("{depth_name}: {reason}"));
        let time =
            time(&metadata, index, destination).ok_or_else(|| damaged("its time is none".to_owned()))?;
        destination.add_colour(time, &Picture::Encoded(jpeg), path)?;
        let bytes = decompress(&depth, depth_size, 4).map_err(damaged)?;
        // Depth is metres in single precision.
        let (quads, _) = bytes.as_chunks::<4>();
        let metres = quads.iter().map(|quad| f32::from_le_bytes(*quad));
        let (file, far) = metres_png(depth_size, metres).map_err(|error| damaged(error.to_string()))?;
        beyond += far;
        let stem = destination.add_depth(time, &Picture::Encoded(file), path)?;
        if let Some(packed) = part(&format!("rgbd/{index}.conf"))? {
            let grey = decompress(&packed, depth_size, 1).map_err(damaged)?;
            let file = grey_png(depth_size, &grey).map_err(|error| damaged(error.to_string()))?;
            destination.add_confidence(&stem, &Picture::Encoded(file), path)?;
        }
        destination
            .poses
            .extend(metadata.poses.get(index).and_then(world_from_camera).map(|pose| (time, pose)));
        (reading.progress)(index as u64 + 1, all.max(index + 1) as u64);
    }
    if beyond > 0 {
        destination.note(format!("{beyond} pixels of depth are farther than 16 bits reach, and are holes"));
    }
    Ok(Facts::new(camera, UNITS_OF_METRES).telephone())
}

fn camera(metadata: &Metadata) -> PinholeCamera {
    // Column by column: the second row begins at the second number.
    let [fx, _, _, _, fy, _, cx, cy, _] = metadata.matrix;
    PinholeCamera { width: metadata.w, height: metadata.h, fx, fy, cx, cy }
}

fn world_from_camera(numbers: &[f64; 7]) -> Option<RigidTransform> {
    let [qx, qy, qz, qw, x, y, z] = *numbers;
    pose::from_quaternion([x, y, z], [qx, qy, qz, qw]).map(|pose| pose::from_opengl(&pose))
}

/// The time of a frame; older files have none but a rate.
fn time(metadata: &Metadata, index: usize, destination: &mut Destination) -> Option<Time> {
    if let Some(seconds) = metadata.frame_timestamps.get(index) {
        return Time::from_seconds(*seconds);
    }
    let rate = metadata.fps.filter(|rate| *rate > 0.0).unwrap_or(60.0);
    destination.note(format!("frames have no times: {rate} per second are assumed"));
    Time::from_seconds(index as f64 / rate)
}

/// What LZFSE makes of an image with that many bytes per pixel.
fn decompress(packed: &[u8], size: (usize, usize), bytes_per_pixel: usize) -> Result<Vec<u8>, String> {
    let pixels = size.0.saturating_mul(size.1);
    if pixels > MOST_PIXELS {
        return Err(format!("it claims to have {} x {} pixels", size.0, size.1));
    }
    let expected = pixels * bytes_per_pixel;
    let mut decoder = LzfseRingDecoder::default();
    let (mut input, mut bytes) = (packed, Vec::new());
    // One byte more than there should be tells when there are too many.
    let read = decoder.reader(&mut input).take(expected as u64 + 1).read_to_end(&mut bytes);
    read.map_err(|error| format!("it cannot be decompressed: {error}"))?;
    if bytes.len() != expected {
        return Err(format!("it has {} bytes, expected {expected}", bytes.len()));
    }
    Ok(bytes)
}
