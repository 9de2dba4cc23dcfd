//! Files of ScanNet's own recorder, `.sens`, version 4: both cameras, then frames with colour as JPEG or PNG and depth as it
//! is or deflated, then samples of an IMU.

use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;
use mba_io::dataset::{DepthCamera, Shutter};
use mba_tracker::geometry::{Distortion, PinholeCamera, RigidTransform};

use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading};
use crate::picture::{MOST_PIXELS, Picture, colour_png, depth_png};
use crate::stream::Stream;
use crate::time::Time;
use crate::{ImportError, pose};

pub(crate) const FORMAT: Format =
    Format { name: "ScanNet's recorder", looked_for: "a .sens file", recognise, read };

const VERSION: u32 = 4;

/// Bytes of the largest name of a sensor, and of the largest image.
const LONGEST_NAME: u64 = 4096;
const LARGEST_IMAGE: u64 = 256 << 20;

/// Frames per second of the recordings, for files without times.
const FRAME_RATE: f64 = 30.0;

fn recognise(path: &Path) -> bool {
    path.is_file() && path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("sens"))
}

/// What stands before the frames.
struct Head {
    colour: PinholeCamera,
    depth: PinholeCamera,
    colour_from_depth: RigidTransform,
    colour_form: i32,
    depth_form: i32,
    /// Raw units of depth per metre.
    scale: f64,
    frames: u64,
}

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let mut stream = Stream::open(reading.path)?;
    let head = head(&mut stream)?;
    let mut bytes = Vec::new();
    // Some exports have zero for the time of every frame.
    let mut has_times = false;
    for index in 0..head.frames {
        let world_from_camera = matrix(&mut stream)?;
        let [colour_time, depth_time, colour_bytes, depth_bytes] =
            [stream.u64()?, stream.u64()?, stream.u64()?, stream.u64()?];
        has_times |= colour_time != 0;
        let time = |microseconds: u64| match has_times {
            true => microseconds.checked_mul(1000).and_then(Time::from_nanoseconds),
            false => Time::from_seconds(index as f64 / FRAME_RATE),
        };
        let (Some(colour_time), Some(depth_time)) = (time(colour_time), time(depth_time)) else {
            return Err(stream.damaged("the time of a frame makes no sense"));
        };
        stream.read(colour_bytes, LARGEST_IMAGE, &mut bytes)?;
        let picture = colour(&head, &bytes).map_err(|reason| stream.damaged(reason))?;
        destination.add_colour(colour_time, &picture, reading.path)?;
        stream.read(depth_bytes, LARGEST_IMAGE, &mut bytes)?;
        let picture = depth(&head, &bytes).map_err(|reason| stream.damaged(reason))?;
        destination.add_depth(depth_time, &picture, reading.path)?;
        destination.poses.extend(pose::from_rows(&world_from_camera).map(|pose| (colour_time, pose)));
        let (all, at) = stream.place();
        (reading.progress)(at, all);
    }
    if !has_times {
        destination.note("frames have no times: 30 per second are assumed");
    }
    let mut facts = Facts::new(head.colour, head.scale);
    facts.readout = Some(Shutter::Rolling { seconds: None });
    facts.depth_camera = (head.depth != head.colour || head.colour_from_depth != RigidTransform::identity())
        .then_some(DepthCamera {
            camera: head.depth,
            distortion: Distortion::default(),
            colour_from_depth: head.colour_from_depth,
        });
    Ok(facts)
}

fn head(stream: &mut Stream) -> Result<Head, ImportError> {
    if stream.u32()? != VERSION {
        return Err(stream.damaged("it is no .sens file of version 4"));
    }
    let name = stream.u64()?;
    stream.read(name, LONGEST_NAME, &mut Vec::new())?;
    let [colour, colour_place, depth, depth_place] =
        [matrix(stream)?, matrix(stream)?, matrix(stream)?, matrix(stream)?];
    let [colour_form, depth_form] = [stream.array::<4>()?, stream.array::<4>()?].map(i32::from_le_bytes);
    let [colour_width, colour_height, depth_width, depth_height] =
        [stream.u32()?, stream.u32()?, stream.u32()?, stream.u32()?].map(|side| side as usize);
    let scale = f64::from(f32::from_le_bytes(stream.array()?));
    let frames = stream.u64()?;
    let camera = |rows: [f64; 16], width: usize, height: usize| PinholeCamera {
        width,
        height,
        fx: rows[0],
        fy: rows[5],
        cx: rows[2],
        cy: rows[6],
    };
    // Extrinsics take points of the sensor to those of either camera.
    let place = |rows: [f64; 16]| pose::from_rows(&rows).unwrap_or_default();
    let (colour_from_sensor, depth_from_sensor) = (place(colour_place), place(depth_place));
    Ok(Head {
        colour: camera(colour, colour_width, colour_height),
        depth: camera(depth, depth_width, depth_height),
        colour_from_depth: if colour_from_sensor == depth_from_sensor {
            RigidTransform::identity()
        } else {
            colour_from_sensor.compose(&depth_from_sensor.inverse())
        },
        colour_form,
        depth_form,
        scale,
        frames,
    })
}

/// Sixteen numbers, row by row.
fn matrix(stream: &mut Stream) -> Result<[f64; 16], ImportError> {
    let bytes = stream.array::<64>()?;
    let (numbers, _) = bytes.as_chunks::<4>();
    Ok(std::array::from_fn(|index| f64::from(f32::from_le_bytes(numbers[index]))))
}

fn colour(head: &Head, bytes: &[u8]) -> Result<Picture, String> {
    match head.colour_form {
        0 => colour_png((head.colour.width, head.colour.height), bytes)
            .map(Picture::Encoded)
            .map_err(|error| error.to_string()),
        1 | 2 => Ok(Picture::Encoded(bytes.to_vec())),
        other => Err(format!("colour is stored in the form {other}; raw, PNG and JPEG are read")),
    }
}

fn depth(head: &Head, bytes: &[u8]) -> Result<Picture, String> {
    let size = (head.depth.width, head.depth.height);
    let pixels = size.0.saturating_mul(size.1);
    if pixels > MOST_PIXELS {
        return Err(format!("depth images claim to have {} x {} pixels", size.0, size.1));
    }
    let mut raw = Vec::new();
    let raw = match head.depth_form {
        0 => bytes,
        1 => {
            // One byte more than there should be tells when there are too many.
            let read = ZlibDecoder::new(bytes).take(2 * pixels as u64 + 1).read_to_end(&mut raw);
            read.map_err(|error| format!("a depth image cannot be inflated: {error}"))?;
            raw.as_slice()
        }
        other => return Err(format!("depth is stored in the form {other}; raw and deflated are read")),
    };
    let (pairs, rest) = raw.as_chunks::<2>();
    if pairs.len() != pixels || !rest.is_empty() {
        return Err(format!("a depth image has {} bytes, expected {}", raw.len(), 2 * pixels));
    }
    let values: Vec<u16> = pairs.iter().map(|pair| u16::from_le_bytes(*pair)).collect();
    depth_png(size, &values).map(Picture::Encoded).map_err(|error| error.to_string())
}
