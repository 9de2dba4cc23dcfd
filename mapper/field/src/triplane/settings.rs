//! What a field is made of.

use serde::{Deserialize, Serialize};

/// Features per node of a plane. Twice as many make a sample nearly twice as slow.
pub const CHANNELS: usize = 8;

/// Features of a sample: those of the coarse planes, then those of the fine ones.
pub const FEATURES: usize = 2 * CHANNELS;

/// Units per hidden layer of a decoder (ESLAM).
pub const HIDDEN: usize = 16;

/// Cell of the coarse planes, metres (ESLAM). Everything else is snapped to this grid.
pub const COARSE_CELL: f64 = 0.24;

/// Most cells of a fine plane along a coarse cell.
pub const MOST_REFINEMENT: u32 = 64;

/// Resolution of a field and where it is truncated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldSettings {
    /// Cells of the fine geometry planes along one coarse cell, 1 to [`MOST_REFINEMENT`].
    pub geometry_cells: u32,
    /// Cells of the fine colour planes along one coarse cell, 1 to [`MOST_REFINEMENT`].
    pub colour_cells: u32,
    /// Signed distance that counts as 1, metres, positive (MBA-SLAM and ESLAM: 0.06).
    pub truncation: f32,
    /// How sharp surfaces are at first: the factor beta of the opacity, positive (ESLAM: 10).
    pub sharpness: f32,
}

impl Default for FieldSettings {
    fn default() -> Self {
        // Cells of 6 cm for geometry, the length of the truncation, and of 1.5 cm for colours.
        Self { geometry_cells: 4, colour_cells: 16, truncation: 0.06, sharpness: 10.0 }
    }
}
