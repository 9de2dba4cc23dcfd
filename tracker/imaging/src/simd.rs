//! Choice of the instruction set. It is an input of every kernel, never ambient.

use arrayvec::ArrayVec;
pub use fearless_simd::Level;
#[cfg(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64"))]
use fearless_simd::Simd;

/// Every level that a CPU with level `best` can run, weakest first; used to compare levels with each other.
///
/// The scalar level is among them when the crate is built with the feature `scalar`.
#[must_use]
pub fn levels_up_to(best: Level) -> ArrayVec<Level, 5> {
    let mut levels = ArrayVec::new();
    #[cfg(any(test, feature = "scalar"))]
    levels.push(Level::fallback());
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        levels.extend(best.as_sse2().map(Simd::level));
        levels.extend(best.as_sse4_2().map(Simd::level));
        levels.extend(best.as_avx2().map(Simd::level));
        levels.extend(best.as_avx512().map(Simd::level));
    }
    #[cfg(target_arch = "aarch64")]
    levels.extend(best.as_neon().map(Simd::level));
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
    levels.push(best);
    levels
}

/// Short name of a level, e.g. `avx2`.
#[must_use]
pub fn level_name(level: Level) -> &'static str {
    match level {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Sse2(_) => "sse2",
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Sse4_2(_) => "sse4.2",
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Avx2(_) => "avx2",
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Level::Avx512(_) => "avx512",
        #[cfg(target_arch = "aarch64")]
        Level::Neon(_) => "neon",
        _ => "scalar",
    }
}
