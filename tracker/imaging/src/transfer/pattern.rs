//! The pixels of a patch.

/// Pixels per patch: whole vectors of every SIMD width up to 16 lanes.
pub const PATCH_PIXELS: usize = 32;

/// Largest absolute offset of a pattern pixel from the patch centre, in pixels.
pub const PATTERN_RADIUS: usize = 4;

/// Column offsets of the pattern: one colour of an 8x8 chessboard, which covers the same area as 64 pixels with
/// half the work.
pub const PATTERN_DU: [i32; PATCH_PIXELS] = chessboard(true);

/// Row offsets of the pattern, see [`PATTERN_DU`].
pub const PATTERN_DV: [i32; PATCH_PIXELS] = chessboard(false);

/// [`PATTERN_DU`] for kernels.
pub(super) const PATTERN_DU_F32: [f32; PATCH_PIXELS] = in_f32(&PATTERN_DU);

/// [`PATTERN_DV`] for kernels.
pub(super) const PATTERN_DV_F32: [f32; PATCH_PIXELS] = in_f32(&PATTERN_DV);

const fn in_f32(offsets: &[i32; PATCH_PIXELS]) -> [f32; PATCH_PIXELS] {
    let mut floats = [0.0; PATCH_PIXELS];
    let mut k = 0;
    while k < PATCH_PIXELS {
        floats[k] = offsets[k] as f32;
        k += 1;
    }
    floats
}

const fn chessboard(columns: bool) -> [i32; PATCH_PIXELS] {
    let mut offsets = [0; PATCH_PIXELS];
    let mut k = 0;
    while k < PATCH_PIXELS {
        let row = (k / 4) as i32;
        let column = 2 * (k % 4) as i32 + row % 2;
        offsets[k] = if columns { column - 4 } else { row - 4 };
        k += 1;
    }
    offsets
}
