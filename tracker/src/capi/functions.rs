//! The functions that C calls.

use core::ffi::{c_char, c_void};
use core::mem::{align_of, size_of};
use core::{ptr, slice};

use super::codes::{
    MBA_ERROR_CONFIG, MBA_ERROR_MISALIGNED, MBA_ERROR_NULL_POINTER, MBA_ERROR_SHORT_BUFFER,
    MBA_MEMORY_ALIGNMENT, MBA_OK, as_c, code_of_config, code_of_frame, describe, status_name,
};
use super::types::{MAGIC, MbaConfig, MbaDepth, MbaFrame, MbaImage, MbaPose, MbaResult, MbaTracker};
use super::{convert, pointers};
use crate::geometry::PinholeCamera;
use crate::photometric::InverseResponse;
use crate::{SimdLevel, Tracker, TrackerConfig};

const _: () = assert!(align_of::<MbaTracker>() <= MBA_MEMORY_ALIGNMENT);

/// Bytes in front of the working memory.
const HEAD_BYTES: usize = size_of::<MbaTracker>().next_multiple_of(MBA_MEMORY_ALIGNMENT);

/// Version of the library: major << 16 | minor << 8 | patch.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub extern "C" fn mba_version() -> u32 {
    let number = |text: &str| text.bytes().fold(0, |sum, digit| 10 * sum + u32::from(digit - b'0'));
    number(env!("CARGO_PKG_VERSION_MAJOR")) << 16
        | number(env!("CARGO_PKG_VERSION_MINOR")) << 8
        | number(env!("CARGO_PKG_VERSION_PATCH"))
}

/// What a returned code means; never null, valid for ever.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub extern "C" fn mba_error_string(code: i32) -> *const c_char {
    as_c(describe(code))
}

/// Name of a frame's status; never null, valid for ever.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub extern "C" fn mba_status_string(status: i32) -> *const c_char {
    as_c(status_name(status))
}

/// Fills `config` with a calibration and the most accurate settings. The calibration is not checked yet.
///
/// # Safety
/// `config`: null, misaligned, or writable for one `MbaConfig`.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "a calibration is a list of numbers in C")]
pub unsafe extern "C" fn mba_config_default(
    config: *mut MbaConfig,
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    metres_per_unit: f32,
) -> i32 {
    let camera = PinholeCamera { width: width as usize, height: height as usize, fx, fy, cx, cy };
    // SAFETY: passed on from the caller.
    unsafe { write_settings(config, &TrackerConfig::new(camera, metres_per_unit, InverseResponse::linear())) }
}

/// Fills `config` with a calibration and settings for devices with little memory. The calibration is not checked yet.
///
/// # Safety
/// `config`: null, misaligned, or writable for one `MbaConfig`.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "a calibration is a list of numbers in C")]
pub unsafe extern "C" fn mba_config_compact(
    config: *mut MbaConfig,
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    metres_per_unit: f32,
) -> i32 {
    let camera = PinholeCamera { width: width as usize, height: height as usize, fx, fy, cx, cy };
    // SAFETY: passed on from the caller.
    unsafe {
        write_settings(config, &TrackerConfig::compact(camera, metres_per_unit, InverseResponse::linear()))
    }
}

/// Writes to `bytes` how much memory `mba_tracker_init` needs, aligned to `MBA_MEMORY_ALIGNMENT`.
///
/// # Safety
/// `config`: null, misaligned, or one `MbaConfig` whose response is null or has 256 values. `bytes`: null, misaligned, or
/// writable.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mba_memory_size(config: *const MbaConfig, bytes: *mut usize) -> i32 {
    code(|| {
        pointers::check_output(bytes)?;
        // SAFETY: passed on from the caller.
        let config = unsafe { convert::config(pointers::read(config)?) }?;
        // SAFETY: checked, and writable as the caller says.
        unsafe { bytes.write(memory_len(&config)?) };
        Ok(())
    })
}

/// Builds a tracker in `memory` and writes its handle, which points into `memory`, to `tracker`. There is nothing to
/// free: the memory is the caller's.
///
/// # Safety
/// `memory`: null, misaligned, or `memory_bytes` writable bytes that nothing else uses from now on. `config`: null,
/// misaligned, or one `MbaConfig` whose response is null or has 256 values. `tracker`: null, misaligned, or writable.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mba_tracker_init(
    memory: *mut c_void,
    memory_bytes: usize,
    config: *const MbaConfig,
    tracker: *mut *mut MbaTracker,
) -> i32 {
    code(|| {
        pointers::check_output(tracker)?;
        if memory.is_null() {
            return Err(MBA_ERROR_NULL_POINTER);
        }
        if memory.align_offset(MBA_MEMORY_ALIGNMENT) != 0 {
            return Err(MBA_ERROR_MISALIGNED);
        }
        // SAFETY: passed on from the caller.
        let settings = unsafe { pointers::read(config) }?;
        // SAFETY: passed on from the caller.
        let config = unsafe { convert::config(settings) }?;
        let needed = memory_len(&config)?;
        if memory_bytes < needed {
            return Err(MBA_ERROR_SHORT_BUFFER);
        }
        // SAFETY: at least `needed` bytes are there, they are aligned, and they are the tracker's alone.
        unsafe { *tracker = place(memory.cast(), needed, settings, &config)? };
        Ok(())
    })
}

/// Tracks one frame and writes what was found to `result`. A frame that is refused leaves the tracker as it was.
///
/// # Safety
/// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile. `frame`: null, misaligned,
/// or one `MbaFrame` whose images have as many bytes as they say and whose angular velocity is null or has three values.
/// `result`: null, misaligned, or writable.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mba_track(
    tracker: *mut MbaTracker,
    frame: *const MbaFrame,
    result: *mut MbaResult,
) -> i32 {
    code(|| {
        pointers::check_output(result)?;
        // SAFETY: passed on from the caller.
        let (handle, frame) =
            unsafe { (pointers::tracker(tracker)?, convert::frame(pointers::read(frame)?)?) };
        let now = || handle.clock.map_or(0, |clock| clock());
        let before = now();
        let found = handle.tracker.track(&frame).map_err(code_of_frame)?;
        let ticks = now().wrapping_sub(before);
        // SAFETY: checked, and writable as the caller says.
        unsafe { result.write(convert::result(&found, ticks)) };
        Ok(())
    })
}

/// Replaces the keyframe by a sharp view from outside, for example rendered from a map; its pose is in the tracker's
/// world. Tracking starts from it if no frame was tracked yet.
///
/// # Safety
/// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile. The others: null,
/// misaligned, or one value each, and images have as many bytes as they say.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mba_set_reference(
    tracker: *mut MbaTracker,
    image: *const MbaImage,
    depth: *const MbaDepth,
    world_from_camera: *const MbaPose,
) -> i32 {
    code(|| {
        // SAFETY: passed on from the caller.
        let (handle, view) =
            unsafe { (pointers::tracker(tracker)?, convert::view(image, depth, world_from_camera)?) };
        handle.tracker.set_reference(&view).map_err(code_of_frame)
    })
}

/// Replaces the keyframe as `mba_set_reference` does and goes on near `world_from_camera`, wherever the camera was thought
/// to be before: for a lost tracker whose place was recognised. `world_from_view` is the pose of the images. How the
/// camera moves is unknown until the next frame. When anything is refused the tracker stays as it was.
///
/// # Safety
/// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile. The others: null,
/// misaligned, or one value each, and images have as many bytes as they say.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mba_relocate(
    tracker: *mut MbaTracker,
    image: *const MbaImage,
    depth: *const MbaDepth,
    world_from_view: *const MbaPose,
    world_from_camera: *const MbaPose,
) -> i32 {
    code(|| {
        // SAFETY: passed on from the caller.
        let (handle, view) =
            unsafe { (pointers::tracker(tracker)?, convert::view(image, depth, world_from_view)?) };
        // SAFETY: passed on from the caller.
        let camera = convert::transform(unsafe { pointers::read(world_from_camera) }?);
        handle.tracker.relocate(&view, &camera).map_err(code_of_frame)
    })
}

/// Moves all that the tracker remembers into another world, as a loop closure does: `new_world_from_world` maps points of
/// the world so far into the new one, in which later poses are. Nothing else changes.
///
/// # Safety
/// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile. `new_world_from_world`:
/// null, misaligned, or one `MbaPose`.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mba_move_world(
    tracker: *mut MbaTracker,
    new_world_from_world: *const MbaPose,
) -> i32 {
    code(|| {
        // SAFETY: passed on from the caller.
        let (handle, moved) = unsafe { (pointers::tracker(tracker)?, pointers::read(new_world_from_world)?) };
        handle.tracker.move_world(&convert::transform(moved)).map_err(code_of_frame)
    })
}

/// Forgets everything but the configuration; the next frame starts a new world.
///
/// # Safety
/// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile.
// SAFETY: no other symbol of this name is linked.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mba_reset(tracker: *mut MbaTracker) -> i32 {
    code(|| {
        // SAFETY: passed on from the caller.
        unsafe { pointers::tracker(tracker) }?.tracker.reset();
        Ok(())
    })
}

fn code(body: impl FnOnce() -> Result<(), i32>) -> i32 {
    body().map_or_else(|code| code, |()| MBA_OK)
}

/// # Safety
/// `config`: null, misaligned, or writable for one `MbaConfig`.
unsafe fn write_settings(config: *mut MbaConfig, settings: &TrackerConfig) -> i32 {
    code(|| {
        pointers::check_output(config)?;
        // SAFETY: checked, and writable as the caller says.
        unsafe { config.write(convert::settings(settings)) };
        Ok(())
    })
}

/// Bytes of handle and working memory.
fn memory_len(config: &TrackerConfig) -> Result<usize, i32> {
    HEAD_BYTES.checked_add(config.workspace_len()).ok_or(MBA_ERROR_CONFIG)
}

/// # Safety
/// `memory`: `bytes` writable bytes, aligned to [`MBA_MEMORY_ALIGNMENT`] and more than [`HEAD_BYTES`], that nothing else
/// uses as long as the tracker is used.
unsafe fn place(
    memory: *mut u8,
    bytes: usize,
    settings: &MbaConfig,
    config: &TrackerConfig,
) -> Result<*mut MbaTracker, i32> {
    // SAFETY: within the memory. Written first, because C's memory may be uninitialised; disjoint from the head.
    let work = unsafe {
        ptr::write_bytes(memory, 0, bytes);
        slice::from_raw_parts_mut(memory.add(HEAD_BYTES), bytes - HEAD_BYTES)
    };
    let tracker = Tracker::new(config, SimdLevel::baseline(), work).map_err(code_of_config)?;
    let handle = memory.cast::<MbaTracker>();
    // SAFETY: the head has the size and the alignment of a handle.
    unsafe { handle.write(MbaTracker { magic: MAGIC, clock: settings.clock, tracker }) };
    Ok(handle)
}
