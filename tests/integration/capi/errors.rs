//! Every way to be refused, with its code.

use core::ffi::CStr;
use core::ptr::{null, null_mut};

use mba_tracker::capi::codes::*;
use mba_tracker::capi::types::{MbaConfig, MbaDepth, MbaFrame, MbaImage, MbaPose, MbaResult};
use mba_tracker::capi::{
    mba_config_default, mba_error_string, mba_memory_size, mba_move_world, mba_relocate, mba_reset,
    mba_set_reference, mba_track, mba_tracker_init,
};

use super::{Bench, frame_of};

/// One byte further: misaligned for everything but bytes.
fn shifted<T>(pointer: *const T) -> *mut T {
    pointer.cast::<u8>().wrapping_add(1).cast::<T>().cast_mut()
}

fn with(config: &MbaConfig, change: impl FnOnce(&mut MbaConfig)) -> i32 {
    let (mut changed, mut bytes) = (*config, 0);
    change(&mut changed);
    // SAFETY: both pointers are valid; a response is null or has 256 values.
    unsafe { mba_memory_size(&changed, &mut bytes) }
}

#[test]
fn configurations() {
    let bench = Bench::new(1);
    let flat = [0.5f32; 256];
    let mut nan: [f32; 256] = core::array::from_fn(|byte| byte as f32);
    nan[100] = f32::NAN;
    assert_eq!(with(&bench.config, |_| ()), MBA_OK);
    type Change<'a> = &'a dyn Fn(&mut MbaConfig);
    let bad: [Change; 15] = [
        &|c| c.fx = f64::NAN,
        &|c| c.fy = f64::INFINITY,
        &|c| c.cx = f64::NAN,
        &|c| c.cy = f64::NEG_INFINITY,
        &|c| c.width = 0,
        &|c| c.height = u32::MAX,
        &|c| c.metres_per_unit = f32::NAN,
        &|c| c.levels = u32::MAX,
        &|c| c.levels = 0,
        &|c| c.surface_level = c.levels,
        &|c| c.recent_keyframes = 5,
        &|c| c.reference = 2,
        &|c| c.effort = -1,
        &|c| c.response = flat.as_ptr(),
        &|c| c.response = nan.as_ptr(),
    ];
    for (k, change) in bad.iter().enumerate() {
        assert_eq!(with(&bench.config, change), MBA_ERROR_CONFIG, "change {k}");
    }
    assert_eq!(with(&bench.config, |c| c.response = shifted(flat.as_ptr())), MBA_ERROR_MISALIGNED);
}

#[test]
fn memory_and_pointers_at_construction() {
    let mut bench = Bench::new(1);
    let (memory, len) = (bench.memory.as_mut_ptr().cast::<core::ffi::c_void>(), bench.bytes());
    let (config, mut tracker, mut size) = (bench.config, null_mut(), 0usize);
    let mut filled = bench.config;
    // SAFETY: pointers are null, misaligned or valid, and lengths those of what they point to or less.
    unsafe {
        assert_eq!(mba_tracker_init(null_mut(), len, &config, &mut tracker), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_tracker_init(memory, len, null(), &mut tracker), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_tracker_init(memory, len, &config, null_mut()), MBA_ERROR_NULL_POINTER);
        for offset in [1, 8, 32] {
            let code = mba_tracker_init(memory.byte_add(offset), len - 64, &config, &mut tracker);
            assert_eq!(code, MBA_ERROR_MISALIGNED);
        }
        assert_eq!(mba_tracker_init(memory, len, shifted(&config), &mut tracker), MBA_ERROR_MISALIGNED);
        assert_eq!(mba_memory_size(&config, null_mut()), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_memory_size(&config, shifted(&size)), MBA_ERROR_MISALIGNED);
        assert_eq!(mba_memory_size(&config, &mut size), MBA_OK);
        for short in [0, 1, 4096, size - 1] {
            assert_eq!(mba_tracker_init(memory, short, &config, &mut tracker), MBA_ERROR_SHORT_BUFFER);
        }
        assert!(tracker.is_null());
        assert_eq!(mba_tracker_init(memory, size, &config, &mut tracker), MBA_OK);
        assert_eq!(mba_config_default(null_mut(), 1, 1, 0.0, 0.0, 0.0, 0.0, 0.0), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_config_default(&mut filled, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0), MBA_OK);
    }
    assert_eq!(with(&filled, |_| ()), MBA_ERROR_CONFIG);
}

#[test]
fn handles() {
    let mut bench = Bench::new(1);
    let no_tracker = bench.memory.as_mut_ptr().cast();
    let frame = frame_of(&bench.frames[0]);
    let mut result = core::mem::MaybeUninit::<MbaResult>::uninit();
    let result = result.as_mut_ptr();
    // SAFETY: pointers are null, misaligned or valid; the memory without a tracker is initialised.
    unsafe {
        assert_eq!(mba_track(no_tracker, &frame, result), MBA_ERROR_NOT_INITIALISED);
        assert_eq!(mba_reset(no_tracker), MBA_ERROR_NOT_INITIALISED);
        assert_eq!(mba_reset(null_mut()), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_reset(shifted(no_tracker)), MBA_ERROR_MISALIGNED);
        let (_, tracker) = bench.init();
        assert_eq!(mba_track(tracker, null(), result), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_track(tracker, &frame, null_mut()), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_track(tracker, &frame, shifted(result)), MBA_ERROR_MISALIGNED);
    }
}

#[test]
fn frames() {
    let mut bench = Bench::new(1);
    let (_, tracker) = bench.init();
    let good = frame_of(&bench.frames[0]);
    let rate = [0.0, f64::NAN, 0.0];
    type Change<'a> = &'a dyn Fn(&mut MbaFrame);
    let bad: [(i32, Change); 19] = [
        (MBA_ERROR_NULL_POINTER, &|f| f.image.data = null()),
        (MBA_ERROR_NULL_POINTER, &|f| f.depth.data = null()),
        (MBA_ERROR_MISALIGNED, &|f| f.depth.data = shifted(f.depth.data)),
        (MBA_ERROR_SHORT_BUFFER, &|f| f.image.size_bytes -= 1),
        (MBA_ERROR_SHORT_BUFFER, &|f| f.image.height = u32::MAX),
        (MBA_ERROR_SHORT_BUFFER, &|f| f.image.size_bytes = usize::MAX),
        (MBA_ERROR_SHORT_BUFFER, &|f| f.depth.size_bytes -= 1),
        (MBA_ERROR_IMAGE_SIZE, &|f| f.image.height -= 1),
        (MBA_ERROR_IMAGE_SIZE, &|f| f.depth.width -= 1),
        (MBA_ERROR_IMAGE_SIZE, &|f| f.image.height = 0),
        (MBA_ERROR_STRIDE, &|f| f.image.stride_bytes -= 1),
        (MBA_ERROR_STRIDE, &|f| f.image.format = MBA_PIXEL_RGB8),
        (MBA_ERROR_STRIDE, &|f| f.depth.stride_bytes += 1),
        (MBA_ERROR_STRIDE, &|f| f.depth.stride_bytes -= 2),
        (MBA_ERROR_PIXEL_FORMAT, &|f| f.image.format = 0),
        (MBA_ERROR_TIMESTAMP, &|f| f.timestamp = f64::NAN),
        (MBA_ERROR_EXPOSURE, &|f| f.exposure = -0.01),
        (MBA_ERROR_EXPOSURE, &|f| f.exposure = f64::NAN),
        (MBA_ERROR_ANGULAR_VELOCITY, &|f| f.angular_velocity = rate.as_ptr()),
    ];
    let mut result = core::mem::MaybeUninit::<MbaResult>::uninit();
    for (k, (code, change)) in bad.iter().enumerate() {
        let mut frame = good;
        change(&mut frame);
        // SAFETY: images that are not refused have as many bytes as they say.
        assert_eq!(unsafe { mba_track(tracker, &frame, result.as_mut_ptr()) }, *code, "change {k}");
    }
}

#[test]
fn views_and_poses_from_outside() {
    let mut bench = Bench::new(1);
    let (_, tracker) = bench.init();
    let frame = frame_of(&bench.frames[0]);
    let (image, depth) = (&frame.image, &frame.depth);
    let good = MbaPose { rotation: [0.0, 0.0, 0.0, 1.0], translation: [0.0; 3] };
    let no_rotation = [[0.0; 4], [f64::NAN; 4], [1.0; 4]].map(|rotation| MbaPose { rotation, ..good });
    let nowhere = MbaPose { translation: [0.0, f64::INFINITY, 0.0], ..good };
    let refused = no_rotation.iter().chain([&nowhere]).map(|pose| (&raw const *pose, MBA_ERROR_POSE));
    let pointers = [(null(), MBA_ERROR_NULL_POINTER), (shifted(&good).cast_const(), MBA_ERROR_MISALIGNED)];
    for (pose, code) in refused.chain(pointers) {
        // SAFETY: poses are null, misaligned or valid; all other pointers are valid.
        unsafe {
            assert_eq!(mba_set_reference(tracker, image, depth, pose), code);
            assert_eq!(mba_relocate(tracker, image, depth, pose, &good), code);
            assert_eq!(mba_relocate(tracker, image, depth, &good, pose), code);
            assert_eq!(mba_move_world(tracker, pose), code);
        }
    }
    let (short, small) =
        (MbaImage { size_bytes: image.size_bytes - 1, ..*image }, MbaDepth { height: 119, ..*depth });
    // SAFETY: pointers are null or valid, and images have as many bytes as they say.
    unsafe {
        assert_eq!(mba_relocate(null_mut(), image, depth, &good, &good), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_relocate(tracker, null(), depth, &good, &good), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_relocate(tracker, image, null(), &good, &good), MBA_ERROR_NULL_POINTER);
        assert_eq!(mba_relocate(tracker, &short, depth, &good, &good), MBA_ERROR_SHORT_BUFFER);
        assert_eq!(mba_set_reference(tracker, image, &small, &good), MBA_ERROR_IMAGE_SIZE);
        assert_eq!(mba_relocate(tracker, image, &small, &good, &good), MBA_ERROR_IMAGE_SIZE);
        assert_eq!(mba_move_world(null_mut(), &good), MBA_ERROR_NULL_POINTER);
    }
}

#[test]
fn every_code_has_a_text_of_its_own() {
    // SAFETY: never null, terminated, static.
    let text = |code| unsafe { CStr::from_ptr(mba_error_string(code)) };
    let unknown = text(-1);
    let texts: std::collections::BTreeSet<_> = (MBA_OK..=MBA_ERROR_DEPTH_TIMESTAMP).map(text).collect();
    assert_eq!(texts.len(), 14);
    assert!(!texts.contains(unknown) && text(14) == unknown);
}
