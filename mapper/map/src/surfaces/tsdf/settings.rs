//! How views are fused.

use crate::surfaces::SurfaceError;

/// How views are fused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FusionSettings {
    /// Edge of a voxel, metres.
    pub voxel: f64,
    /// Voxels in front of and behind a surface that know their distance.
    pub truncation_voxels: f64,
    /// Memory that the grid may take, megabytes.
    pub limit_mb: usize,
}

impl Default for FusionSettings {
    fn default() -> Self {
        Self { voxel: 0.01, truncation_voxels: 4.0, limit_mb: 2048 }
    }
}

impl FusionSettings {
    /// The distance in metres beyond which the grid knows no more than that it is far from the surface.
    #[must_use]
    pub fn truncation(&self) -> f64 {
        self.voxel * self.truncation_voxels
    }

    pub(super) fn check(&self) -> Result<(), SurfaceError> {
        let setting = |name, value, expected| Err(SurfaceError::Setting { name, value, expected });
        // Written so that NaN fails too.
        if !(self.voxel > 0.0 && self.voxel.is_finite()) {
            return setting("voxel", self.voxel, "a positive number of metres");
        }
        if !(1.0..=100.0).contains(&self.truncation_voxels) {
            return setting("truncation", self.truncation_voxels, "1 to 100 voxels");
        }
        Ok(())
    }
}
