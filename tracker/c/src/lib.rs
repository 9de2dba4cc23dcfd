//! Static library `libmba_tracker.a` with the functions of `include/mba_tracker.h`.
//!
//! It wants nothing from the program but `abort`, and `memcpy`, `memmove`, `memset` and `memcmp`, which every C compiler
//! takes for granted.
#![no_std]

use core::panic::PanicInfo;

pub use tracker::capi::*;

unsafe extern "C" {
    safe fn abort() -> !;
}

/// No input leads here; a defect of the library ends the program, or whatever the firmware's `abort` does.
#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    abort()
}
