//! Kinds of maps.

use core::fmt;

use serde::{Deserialize, Serialize};

/// What a map consists of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum MapKind {
    /// 3D Gaussians.
    #[default]
    Gaussians,
    /// A tri-plane field of signed distance and colour.
    Field,
}

/// How large a map is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapSize {
    /// Number of Gaussians.
    Gaussians(usize),
    /// Bytes of a field's planes and decoders in memory.
    FieldBytes(usize),
}

impl MapSize {
    /// Number of Gaussians; 0 for a map of another kind.
    #[must_use]
    pub fn gaussians(&self) -> usize {
        if let Self::Gaussians(count) = self { *count } else { 0 }
    }
}

impl fmt::Display for MapSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gaussians(count) => write!(f, "{count} Gaussians"),
            Self::FieldBytes(bytes) => write!(f, "{:.1} MB of planes", *bytes as f64 / 1e6),
        }
    }
}
