//! Asking for memory before it is needed.
//!
//! The fine planes do not fit into the cache of a core, and a sample needs six places in them: asked for a tile of
//! samples ahead, they arrive together. That takes a tenth off the time of a sample.

/// Asks for the cache line of a value. Does nothing for an index that is out of bounds, and where Rust has no stable
/// instruction for it.
#[inline(always)]
pub(super) fn prefetch(values: &[f32], index: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(value) = values.get(index) {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: every x86-64 CPU has SSE, to which the instruction belongs; the address is that of a live value, and
        // a prefetch neither writes nor faults.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(core::ptr::from_ref(value).cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (values, index);
}
