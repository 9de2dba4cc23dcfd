//! The messages that are read, as their definitions have them.

use mba_tracker::geometry::RigidTransform;

use super::wire::{Encoding, Wire};
use crate::pose;
use crate::time::Time;

/// Most coefficients of a lens model.
const MOST_COEFFICIENTS: usize = 32;

/// Most transforms in one message.
const MOST_TRANSFORMS: usize = 4096;

/// `std_msgs/Header`.
pub(super) struct Header<'a> {
    /// None where it is zero: then the time of recording has to do.
    pub(super) time: Option<Time>,
    pub(super) frame: &'a str,
}

impl<'a> Header<'a> {
    fn read(wire: &mut Wire<'a>) -> Option<Self> {
        if wire.encoding == Encoding::Ros1 {
            // A running number.
            wire.u32()?;
        }
        let (seconds, nanoseconds) = match wire.encoding {
            Encoding::Ros1 => (i64::from(wire.u32()?), wire.u32()?),
            Encoding::Cdr => (i64::from(wire.i32()?), wire.u32()?),
        };
        let frame = wire.text()?;
        let time = if (seconds, nanoseconds) == (0, 0) {
            None
        } else {
            Some(Time::from_parts(seconds, nanoseconds)?)
        };
        Some(Self { time, frame })
    }
}

/// `sensor_msgs/Image`.
pub(super) struct Image<'a> {
    pub(super) header: Header<'a>,
    pub(super) size: (usize, usize),
    pub(super) encoding: &'a str,
    pub(super) is_big_endian: bool,
    /// Bytes from one row to the next.
    pub(super) step: usize,
    pub(super) data: &'a [u8],
    /// Metres of a raw unit, which RealSense adds.
    pub(super) depth_units: Option<f32>,
}

impl<'a> Image<'a> {
    pub(super) fn read(message: &'a [u8], encoding: Encoding) -> Option<Self> {
        let mut wire = Wire::new(message, encoding)?;
        let header = Header::read(&mut wire)?;
        let (height, width) = (wire.u32()? as usize, wire.u32()? as usize);
        let name = wire.text()?;
        let (is_big_endian, step) = (wire.u8()? != 0, wire.u32()? as usize);
        let data = wire.bytes()?;
        let depth_units = wire.f32().filter(|_| encoding == Encoding::Ros1);
        Some(Self { header, size: (width, height), encoding: name, is_big_endian, step, data, depth_units })
    }
}

/// `sensor_msgs/CompressedImage`.
pub(super) struct CompressedImage<'a> {
    pub(super) header: Header<'a>,
    pub(super) format: &'a str,
    pub(super) data: &'a [u8],
}

impl<'a> CompressedImage<'a> {
    pub(super) fn read(message: &'a [u8], encoding: Encoding) -> Option<Self> {
        let mut wire = Wire::new(message, encoding)?;
        Some(Self { header: Header::read(&mut wire)?, format: wire.text()?, data: wire.bytes()? })
    }
}

/// `sensor_msgs/CameraInfo`.
#[derive(Clone, Debug)]
pub(super) struct CameraInfo {
    pub(super) size: (usize, usize),
    pub(super) model: String,
    pub(super) distortion: Vec<f64>,
    /// fx, fy, cx, cy.
    pub(super) intrinsics: [f64; 4],
}

impl CameraInfo {
    pub(super) fn read(message: &[u8], encoding: Encoding) -> Option<Self> {
        let mut wire = Wire::new(message, encoding)?;
        Header::read(&mut wire)?;
        let (height, width) = (wire.u32()? as usize, wire.u32()? as usize);
        let model = wire.text()?.to_owned();
        let distortion = wire.f64_list(MOST_COEFFICIENTS)?;
        let [fx, _, cx, _, fy, cy, ..] = wire.f64s::<9>()?;
        Some(Self { size: (width, height), model, distortion, intrinsics: [fx, fy, cx, cy] })
    }
}

/// `sensor_msgs/Imu`.
pub(super) struct Imu<'a> {
    pub(super) header: Header<'a>,
    /// rad/s; none where the message says that there is no gyroscope.
    pub(super) rate: Option<[f64; 3]>,
    /// m/s^2; none where the message says that there is no accelerometer.
    pub(super) force: Option<[f64; 3]>,
}

impl<'a> Imu<'a> {
    pub(super) fn read(message: &'a [u8], encoding: Encoding) -> Option<Self> {
        let mut wire = Wire::new(message, encoding)?;
        let header = Header::read(&mut wire)?;
        let _orientation = (wire.f64s::<4>()?, wire.f64s::<9>()?);
        let (rate, rate_covariance) = (wire.f64s::<3>()?, wire.f64s::<9>()?);
        let (force, force_covariance) = (wire.f64s::<3>()?, wire.f64s::<9>()?);
        // By the definition of the message, -1 in front means that there is no such sensor.
        let is_there = |covariance: [f64; 9]| covariance[0] != -1.0;
        let finite = |value: [f64; 3]| value.iter().all(|value| value.is_finite());
        Some(Self {
            header,
            rate: Some(rate).filter(|rate| is_there(rate_covariance) && finite(*rate)),
            force: Some(force).filter(|force| is_there(force_covariance) && finite(*force)),
        })
    }
}

/// One transform of `tf2_msgs/TFMessage`.
pub(super) struct Transform<'a> {
    pub(super) parent: &'a str,
    pub(super) child: &'a str,
    pub(super) parent_from_child: RigidTransform,
}

/// The transforms of `tf2_msgs/TFMessage`; those that are no rigid ones are left out.
pub(super) fn transforms(message: &[u8], encoding: Encoding) -> Option<Vec<Transform<'_>>> {
    let mut wire = Wire::new(message, encoding)?;
    let count = wire.u32()? as usize;
    let mut transforms = Vec::new();
    for _ in 0..count.min(MOST_TRANSFORMS) {
        let header = Header::read(&mut wire)?;
        let child = wire.text()?;
        if let Some(parent_from_child) = rigid(&mut wire)? {
            transforms.push(Transform { parent: header.frame, child, parent_from_child });
        }
    }
    Some(transforms)
}

/// `geometry_msgs/Transform`, if it is a rigid one.
pub(super) fn transform(message: &[u8], encoding: Encoding) -> Option<RigidTransform> {
    rigid(&mut Wire::new(message, encoding)?)?
}

fn rigid(wire: &mut Wire<'_>) -> Option<Option<RigidTransform>> {
    let (translation, rotation) = (wire.f64s::<3>()?, wire.f64s::<4>()?);
    Some(pose::from_quaternion(translation, rotation))
}

/// `diagnostic_msgs/KeyValue`.
pub(super) fn key_value(message: &[u8], encoding: Encoding) -> Option<(&str, &str)> {
    let mut wire = Wire::new(message, encoding)?;
    Some((wire.text()?, wire.text()?))
}

/// `std_msgs/Float32`.
pub(super) fn float(message: &[u8], encoding: Encoding) -> Option<f32> {
    Wire::new(message, encoding)?.f32()
}

/// `realsense2_camera_msgs/Metadata`: the time of a frame and JSON.
pub(super) fn metadata(message: &[u8], encoding: Encoding) -> Option<(Option<Time>, &str)> {
    let mut wire = Wire::new(message, encoding)?;
    Some((Header::read(&mut wire)?.time, wire.text()?))
}
