//! From C's pointers to references and slices, with every check that can be made.

use core::mem::size_of;
use core::slice;

use super::codes::{
    MBA_ERROR_MISALIGNED, MBA_ERROR_NOT_INITIALISED, MBA_ERROR_NULL_POINTER, MBA_ERROR_SHORT_BUFFER,
};
use super::types::{MAGIC, MbaTracker};

/// The value that C points to.
///
/// # Safety
/// A pointer that is neither null nor misaligned points to a valid `T` that nobody writes during `'a`.
pub(super) unsafe fn read<'a, T>(pointer: *const T) -> Result<&'a T, i32> {
    check(pointer)?;
    // SAFETY: neither null nor misaligned; the caller vouches for the rest.
    Ok(unsafe { &*pointer })
}

/// `bytes` of C's memory as values.
///
/// # Safety
/// A pointer that is neither null nor misaligned points to `bytes` readable bytes that nobody writes during `'a`.
pub(super) unsafe fn read_slice<'a, T: bytemuck::Pod>(
    pointer: *const T,
    bytes: usize,
) -> Result<&'a [T], i32> {
    check(pointer)?;
    if bytes > isize::MAX as usize {
        return Err(MBA_ERROR_SHORT_BUFFER);
    }
    // SAFETY: neither null nor misaligned, not longer than a slice may be, every bit pattern is a `T`; the caller
    // vouches for the rest.
    Ok(unsafe { slice::from_raw_parts(pointer, bytes / size_of::<T>()) })
}

/// The place where a result goes.
pub(super) fn check_output<T>(pointer: *mut T) -> Result<(), i32> {
    check(pointer)
}

/// The tracker in C's memory.
///
/// # Safety
/// A pointer that is neither null nor misaligned points to eight initialised bytes or more that nobody else uses during
/// `'a`; they do not start with the magic word unless `mba_tracker_init` has written a tracker there.
pub(super) unsafe fn tracker<'a>(pointer: *mut MbaTracker) -> Result<&'a mut MbaTracker, i32> {
    check(pointer)?;
    // SAFETY: the first of the bytes that the caller vouches for, and aligned as the tracker is.
    let magic = unsafe { (&raw const (*pointer).magic).read() };
    if magic != MAGIC {
        return Err(MBA_ERROR_NOT_INITIALISED);
    }
    // SAFETY: the magic word says that a tracker was written here, and the caller that nobody else uses it.
    Ok(unsafe { &mut *pointer })
}

fn check<T>(pointer: *const T) -> Result<(), i32> {
    if pointer.is_null() {
        return Err(MBA_ERROR_NULL_POINTER);
    }
    if !pointer.is_aligned() {
        return Err(MBA_ERROR_MISALIGNED);
    }
    Ok(())
}
