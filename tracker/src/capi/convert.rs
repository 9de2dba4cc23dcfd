//! Between the structures of C and those of the crate.

use nalgebra::{Quaternion, SMatrix, Unit, Vector3};

use super::codes::{
    MBA_EFFORT_FULL, MBA_EFFORT_LOW, MBA_EFFORT_MEDIUM, MBA_ERROR_ANGULAR_VELOCITY, MBA_ERROR_CONFIG,
    MBA_ERROR_PIXEL_FORMAT, MBA_ERROR_STRIDE, MBA_PIXEL_GREY8, MBA_PIXEL_RGB8, MBA_REFERENCE_DEBLURRED,
    MBA_REFERENCE_RAW, MBA_STATUS_LOST, MBA_STATUS_OK, MBA_STATUS_WEAK, code_of_frame,
};
use super::pointers::{read, read_slice};
use super::types::{MbaConfig, MbaDepth, MbaFrame, MbaImage, MbaPose, MbaResult};
use crate::align::UNKNOWNS;
use crate::geometry::{PinholeCamera, RigidTransform};
use crate::image::{ColourView, DepthView, PixelFormat};
use crate::photometric::{InverseResponse, Vignetting};
use crate::{Effort, Frame, FrameResult, FrameStatus, Readout, ReferenceMode, ReferenceView, TrackerConfig};

/// The configuration that C asks for, checked.
///
/// # Safety
/// A response that is neither null nor misaligned points to 256 values.
pub(super) unsafe fn config(c: &MbaConfig) -> Result<TrackerConfig, i32> {
    let response = if c.response.is_null() {
        InverseResponse::srgb()
    } else {
        // SAFETY: the caller vouches for 256 values.
        let table = unsafe { read(c.response.cast::<[f32; 256]>()) }?;
        InverseResponse::from_table(table).ok_or(MBA_ERROR_CONFIG)?
    };
    let (width, height) = (c.width as usize, c.height as usize);
    let camera = PinholeCamera { width, height, fx: c.fx, fy: c.fy, cx: c.cx, cy: c.cy };
    let reference = match c.reference {
        MBA_REFERENCE_DEBLURRED => ReferenceMode::Deblurred,
        MBA_REFERENCE_RAW => ReferenceMode::Raw,
        _ => return Err(MBA_ERROR_CONFIG),
    };
    let effort = match c.effort {
        MBA_EFFORT_FULL => Effort::Full,
        MBA_EFFORT_MEDIUM => Effort::Medium,
        MBA_EFFORT_LOW => Effort::Low,
        _ => return Err(MBA_ERROR_CONFIG),
    };
    let depth_apart = match c.depth_apart {
        0 => false,
        1 => true,
        _ => return Err(MBA_ERROR_CONFIG),
    };
    let readout = Readout {
        colour: c.readout_seconds,
        depth: c.depth_readout_seconds,
        depth_apart,
        bands: c.row_bands as usize,
    };
    let config = TrackerConfig {
        levels: c.levels as usize,
        surface_level: c.surface_level as usize,
        recent_keyframes: c.recent_keyframes as usize,
        readout,
        vignetting: Vignetting { a2: c.vignetting_a2, a4: c.vignetting_a4 },
        reference,
        ..TrackerConfig::new(camera, c.metres_per_unit, response).with_effort(effort)
    };
    config.validate().map_err(|_| MBA_ERROR_CONFIG)?;
    Ok(config)
}

/// The settings of a configuration; its response and clock are left out.
pub(super) fn settings(config: &TrackerConfig) -> MbaConfig {
    let camera = &config.camera;
    MbaConfig {
        width: camera.width as u32,
        height: camera.height as u32,
        fx: camera.fx,
        fy: camera.fy,
        cx: camera.cx,
        cy: camera.cy,
        metres_per_unit: config.metres_per_unit,
        levels: config.levels as u32,
        surface_level: config.surface_level as u32,
        recent_keyframes: config.recent_keyframes as u32,
        row_bands: config.readout.bands as u32,
        depth_apart: u32::from(config.readout.depth_apart),
        readout_seconds: config.readout.colour,
        depth_readout_seconds: config.readout.depth,
        vignetting_a2: config.vignetting.a2,
        vignetting_a4: config.vignetting.a4,
        reference: match config.reference {
            ReferenceMode::Deblurred => MBA_REFERENCE_DEBLURRED,
            ReferenceMode::Raw => MBA_REFERENCE_RAW,
        },
        // What effort changes is already in the other settings.
        effort: MBA_EFFORT_FULL,
        response: core::ptr::null(),
        clock: None,
    }
}

/// An image of C.
///
/// # Safety
/// Data that is neither null nor misaligned has `size_bytes` readable bytes during `'a`.
pub(super) unsafe fn colour<'a>(image: &MbaImage) -> Result<ColourView<'a>, i32> {
    let format = match image.format {
        MBA_PIXEL_GREY8 => PixelFormat::Grey8,
        MBA_PIXEL_RGB8 => PixelFormat::Rgb8,
        _ => return Err(MBA_ERROR_PIXEL_FORMAT),
    };
    let (width, stride) = (image.width as usize, image.stride_bytes as usize);
    // Before the bytes are looked at: with a short stride rows would overlap.
    if stride < width.saturating_mul(format.bytes()) {
        return Err(MBA_ERROR_STRIDE);
    }
    // SAFETY: passed on from the caller.
    let data = unsafe { read_slice(image.data, image.size_bytes) }?;
    ColourView::new(data, width, image.height as usize, stride, format)
        .map_err(|error| code_of_frame(error.into()))
}

/// A depth image of C.
///
/// # Safety
/// Data that is neither null nor misaligned has `size_bytes` readable bytes during `'a`.
pub(super) unsafe fn depth<'a>(image: &MbaDepth) -> Result<DepthView<'a>, i32> {
    let (width, stride) = (image.width as usize, image.stride_bytes as usize);
    if stride % 2 != 0 || stride / 2 < width {
        return Err(MBA_ERROR_STRIDE);
    }
    // SAFETY: passed on from the caller.
    let data = unsafe { read_slice(image.data, image.size_bytes) }?;
    DepthView::new(data, width, image.height as usize, stride / 2)
        .map_err(|error| code_of_frame(error.into()))
}

/// A frame of C.
///
/// # Safety
/// As for [`colour`] and [`depth`]; an angular velocity that is neither null nor misaligned has three values.
pub(super) unsafe fn frame<'a>(frame: &MbaFrame) -> Result<Frame<'a>, i32> {
    let angular_velocity = if frame.angular_velocity.is_null() {
        None
    } else {
        // SAFETY: the caller vouches for three values.
        let rate = unsafe { read(frame.angular_velocity.cast::<[f64; 3]>()) }?;
        if !rate.iter().all(|component| component.is_finite()) {
            return Err(MBA_ERROR_ANGULAR_VELOCITY);
        }
        Some(Vector3::from(*rate))
    };
    // SAFETY: passed on from the caller.
    let (colour, depth) = unsafe { (colour(&frame.image)?, depth(&frame.depth)?) };
    Ok(Frame {
        timestamp: frame.timestamp,
        exposure: frame.exposure,
        depth_timestamp: frame.depth_timestamp,
        colour,
        depth,
        angular_velocity,
        gyro: None,
        expected_path: None,
    })
}

/// A view from outside.
///
/// # Safety
/// As for [`colour`] and [`depth`]; pointers that are neither null nor misaligned point to one value each.
pub(super) unsafe fn view<'a>(
    image: *const MbaImage,
    depth_image: *const MbaDepth,
    world_from_camera: *const MbaPose,
) -> Result<ReferenceView<'a>, i32> {
    // SAFETY: passed on from the caller.
    unsafe {
        Ok(ReferenceView {
            colour: colour(read(image)?)?,
            depth: depth(read(depth_image)?)?,
            world_from_camera: transform(read(world_from_camera)?),
        })
    }
}

/// A pose of C as it is; the tracker checks it.
pub(super) fn transform(pose: &MbaPose) -> RigidTransform {
    let rotation = Unit::new_unchecked(Quaternion::from(pose.rotation));
    RigidTransform::new(rotation, Vector3::from(pose.translation))
}

fn pose(transform: &RigidTransform) -> MbaPose {
    MbaPose { rotation: transform.rotation.coords.into(), translation: transform.translation.into() }
}

/// A result for C.
pub(super) fn result(result: &FrameResult, ticks: u64) -> MbaResult {
    let covariance = mid_covariance(&result.information);
    MbaResult {
        index: result.index as u64,
        reference_index: result.reference_index as u64,
        timestamp: result.timestamp,
        status: match result.status {
            FrameStatus::Ok => MBA_STATUS_OK,
            FrameStatus::Weak => MBA_STATUS_WEAK,
            FrameStatus::Lost => MBA_STATUS_LOST,
        },
        is_keyframe: i32::from(result.is_keyframe),
        world_from_camera_start: pose(&result.world_from_camera.start),
        world_from_camera_end: pose(&result.world_from_camera.end),
        covariance: covariance.unwrap_or([0.0; 36]),
        has_covariance: i32::from(covariance.is_some()),
        iterations: result.iterations as u32,
        blur: result.blur,
        inliers: result.inliers,
        residual: result.residual,
        virtual_views: result.virtual_views as u32,
        ticks,
    }
}

/// Covariance of the centre motion with everything else marginalised; `None` when the information is singular.
fn mid_covariance(information: &SMatrix<f64, UNKNOWNS, UNKNOWNS>) -> Option<[f64; 36]> {
    let factor = information.cholesky()?;
    let mut covariance = [0.0; 36];
    for column in 0..6 {
        let mut unit = SMatrix::<f64, UNKNOWNS, 1>::zeros();
        unit[column] = 1.0;
        factor.solve_mut(&mut unit);
        for row in 0..6 {
            covariance[6 * row + column] = unit[row];
        }
    }
    covariance.iter().all(|value| value.is_finite()).then_some(covariance)
}
