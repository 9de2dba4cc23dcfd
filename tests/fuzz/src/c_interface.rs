//! The functions for C, with pointers and lengths as wrong as their contracts allow: null, misaligned, too short, or
//! memory without a tracker.

use std::ptr::{null, null_mut};

use mba_tracker::capi::codes::{MBA_OK, MBA_PIXEL_GREY8};
use mba_tracker::capi::types::{MbaConfig, MbaDepth, MbaFrame, MbaImage, MbaPose, MbaResult, MbaTracker};
use mba_tracker::capi::{
    mba_config_compact, mba_config_default, mba_error_string, mba_memory_size, mba_move_world, mba_relocate,
    mba_reset, mba_set_reference, mba_status_string, mba_track, mba_tracker_init,
};

use super::numbers::Numbers;
use super::picture::Picture;

/// Calls of one session.
const MOST_CALLS: usize = 8;

/// Largest working memory that is made.
const MOST_MEMORY: usize = 4 << 20;

/// Memory as C's `aligned_alloc` would return it.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([u8; 64]);

/// The pointer itself, or now and then one that is refused.
fn maybe<T>(pointer: *const T, numbers: &mut Numbers<'_>) -> *mut T {
    match numbers.byte() {
        254 => null_mut(),
        255 => pointer.cast::<u8>().wrapping_add(1).cast::<T>().cast_mut(),
        _ => pointer.cast_mut(),
    }
}

/// A configuration, memory, and the calls that follow.
pub fn c_interface(data: &[u8]) {
    let numbers = &mut Numbers::new(data);
    // SAFETY: codes are plain numbers, and the strings are static.
    for text in
        [mba_error_string(numbers.u32().cast_signed()), mba_status_string(numbers.u32().cast_signed())]
    {
        assert!(!text.is_null());
    }
    let mut table: [f32; 256] = core::array::from_fn(|code| code as f32);
    let Some(config) = configuration(&mut table, numbers) else { return };
    let mut bytes = 0_usize;
    // SAFETY: pointers are null, misaligned or valid; a response is null or has 256 values.
    let code = unsafe { mba_memory_size(maybe(&config, numbers), maybe(&raw mut bytes, numbers)) };
    if code != MBA_OK || bytes == 0 || bytes > MOST_MEMORY {
        return;
    }
    let mut memory = vec![Line([0xA5; 64]); bytes.div_ceil(64)];
    let start = memory.as_mut_ptr();
    let given = if numbers.rarely(64) { numbers.u32() as usize % (bytes + 1) } else { bytes };
    let mut tracker: *mut MbaTracker = null_mut();
    // SAFETY: as above, and the memory has at least `given` bytes, which are used for nothing else.
    let code = unsafe {
        mba_tracker_init(
            maybe(start, numbers).cast(),
            given,
            maybe(&config, numbers),
            maybe(&raw mut tracker, numbers),
        )
    };
    assert!(code != MBA_OK || !tracker.is_null());
    // Without a tracker the calls go to null or to memory that holds none.
    let handle = if code == MBA_OK || numbers.rarely(2) { tracker } else { start.cast() };
    let mut time = 0.0;
    for _ in 0..MOST_CALLS {
        if numbers.is_empty() {
            break;
        }
        call(maybe(handle, numbers), &config, &mut time, numbers);
    }
}

/// Settings of which most are valid; `table` is what a response points to.
fn configuration(table: &mut [f32; 256], numbers: &mut Numbers<'_>) -> Option<MbaConfig> {
    let mut config = core::mem::MaybeUninit::<MbaConfig>::uninit();
    let place = maybe(config.as_mut_ptr(), numbers);
    let [width, height] = [0, 1].map(|_| 32 + numbers.below(48) as u32);
    let width = if numbers.rarely(64) { numbers.u32() } else { width };
    let [fx, fy] = [0, 1].map(|_| numbers.near(40.0, 20.0));
    let [cx, cy] = [0, 1].map(|_| numbers.near(25.0, 10.0));
    let scale = numbers.near(0.001, 0.0005) as f32;
    let make = if numbers.rarely(2) { mba_config_compact } else { mba_config_default };
    // SAFETY: the pointer is null, misaligned or writable, and what it points to was written when the code says so.
    let mut config = unsafe {
        if make(place, width, height, fx, fy, cx, cy, scale) != MBA_OK {
            return None;
        }
        config.assume_init()
    };
    let choices = numbers.byte();
    if choices & 1 != 0 {
        (config.levels, config.surface_level) =
            (u32::from(numbers.byte() % 9), u32::from(numbers.byte() % 5));
    }
    if choices & 2 != 0 {
        (config.row_bands, config.depth_apart) =
            (u32::from(numbers.byte() % 20), u32::from(numbers.byte() % 3));
        (config.readout_seconds, config.depth_readout_seconds) =
            (numbers.near(0.0, 0.1), numbers.near(0.0, 0.1));
    }
    if choices & 4 != 0 {
        (config.reference, config.effort) =
            (i32::from(numbers.byte() % 4), i32::from(numbers.byte() % 5) - 1);
        config.recent_keyframes = numbers.u32() % 8;
    }
    if choices & 8 != 0 {
        table[numbers.below(256)] = numbers.near(0.5, 0.5) as f32;
    }
    if choices & 16 != 0 {
        config.response = maybe(table.as_ptr(), numbers);
    }
    Some(config)
}

fn call(tracker: *mut MbaTracker, config: &MbaConfig, time: &mut f64, numbers: &mut Numbers<'_>) {
    let what = numbers.below(16);
    let [width, height] = if numbers.rarely(32) {
        [numbers.u32() % 70_000, numbers.u32() % 70_000]
    } else {
        [config.width, config.height]
    };
    let few = [width, height].map(|length| (length as usize).min(96));
    let mut picture = Picture::new(few[0], few[1], numbers);
    // No address is misaligned for bytes: one further there is still as much as is said.
    picture.grey.push(0);
    let (image, depth) = images(&picture, [width, height], numbers);
    let [place, other] = [pose(numbers), pose(numbers)];
    // SAFETY: pointers are null, misaligned or valid, and the images say no more bytes than there are. The tracker is
    // null, misaligned, one that was made, or memory without the magic word.
    let code = unsafe {
        match what {
            0 => mba_reset(tracker),
            1 => mba_move_world(tracker, maybe(&place, numbers)),
            2 => mba_set_reference(
                tracker,
                maybe(&image, numbers),
                maybe(&depth, numbers),
                maybe(&place, numbers),
            ),
            3 => mba_relocate(
                tracker,
                maybe(&image, numbers),
                maybe(&depth, numbers),
                maybe(&place, numbers),
                maybe(&other, numbers),
            ),
            _ => {
                *time += numbers.near(0.033, 0.03);
                track(tracker, image, depth, *time, numbers)
            }
        }
    };
    assert!(!mba_error_string(code).is_null());
}

/// # Safety
/// As for `mba_track`.
unsafe fn track(
    tracker: *mut MbaTracker,
    image: MbaImage,
    depth: MbaDepth,
    time: f64,
    numbers: &mut Numbers<'_>,
) -> i32 {
    let rates: [f64; 3] = core::array::from_fn(|_| numbers.near(0.0, 1.0));
    let frame = MbaFrame {
        timestamp: time,
        exposure: numbers.near(0.01, 0.01),
        depth_timestamp: time + numbers.near(0.0, 0.1),
        image,
        depth,
        angular_velocity: if numbers.rarely(2) { maybe(rates.as_ptr(), numbers) } else { null() },
    };
    let mut result = core::mem::MaybeUninit::<MbaResult>::uninit();
    // SAFETY: the frame and the result are valid, or their pointers are null or misaligned.
    unsafe { mba_track(tracker, maybe(&frame, numbers), maybe(result.as_mut_ptr(), numbers)) }
}

/// Images whose lengths are true and whose other numbers may be wrong.
fn images(picture: &Picture, [width, height]: [u32; 2], numbers: &mut Numbers<'_>) -> (MbaImage, MbaDepth) {
    let shorter =
        |bytes: usize, numbers: &mut Numbers<'_>| if numbers.rarely(32) { bytes / 2 } else { bytes };
    let stride =
        |bytes: u32, numbers: &mut Numbers<'_>| if numbers.rarely(32) { numbers.u32() } else { bytes };
    let pixels = picture.depth.len();
    let image = MbaImage {
        data: maybe(picture.grey.as_ptr(), numbers),
        size_bytes: shorter(pixels, numbers),
        width,
        height,
        stride_bytes: stride(width, numbers),
        format: if numbers.rarely(16) { i32::from(numbers.byte()) - 2 } else { MBA_PIXEL_GREY8 },
    };
    let depth = MbaDepth {
        data: maybe(picture.depth.as_ptr(), numbers),
        size_bytes: shorter(2 * pixels, numbers),
        width,
        height,
        stride_bytes: stride(width.saturating_mul(2), numbers),
    };
    (image, depth)
}

fn pose(numbers: &mut Numbers<'_>) -> MbaPose {
    let [x, y, z] = [0; 3].map(|_| numbers.near(0.0, 0.1));
    let w = if numbers.rarely(16) {
        numbers.near(1.0, 0.1)
    } else {
        (1.0 - x * x - y * y - z * z).max(0.0).sqrt()
    };
    MbaPose { rotation: [x, y, z, w], translation: [0; 3].map(|_| numbers.near(0.0, 0.2)) }
}
