//! The map of a RUN folder, of either kind.

use std::path::{Path, PathBuf};

use mba_field::triplane::{FieldFileError, TriplaneField, read_field};
use mba_raster::gaussians::{Gaussians, PlyError, read_ply};

use super::scene::Scene;
use super::{FIELD_FILE, MAP_FILE};

/// A map that was read.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a program has one or two, not a list of them")]
pub enum StoredMap {
    /// 3D Gaussians.
    Gaussians(Gaussians),
    /// A tri-plane field.
    Field(Box<TriplaneField>),
}

/// A map cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum MapFileError {
    /// Gaussians cannot.
    #[error(transparent)]
    Gaussians(#[from] PlyError),
    /// A field cannot.
    #[error(transparent)]
    Field(#[from] FieldFileError),
}

impl StoredMap {
    /// Where the map of the RUN folder `folder` lies, if there is one.
    #[must_use]
    pub fn path(folder: &Path) -> Option<PathBuf> {
        [MAP_FILE, FIELD_FILE].map(|name| folder.join(name)).into_iter().find(|path| path.is_file())
    }

    /// Reads a map; what it is shows in the ending of its name.
    ///
    /// # Errors
    /// [`MapFileError`].
    pub fn read(path: &Path) -> Result<Self, MapFileError> {
        let is_field = path.file_name().is_some_and(|name| name == FIELD_FILE);
        Ok(if is_field { Self::Field(Box::new(read_field(path)?)) } else { Self::Gaussians(read_ply(path)?) })
    }

    /// Whether it shows nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        matches!(self, Self::Gaussians(map) if map.is_empty())
    }

    /// Number of Gaussians; 0 for a map of another kind.
    #[must_use]
    pub fn gaussians(&self) -> usize {
        if let Self::Gaussians(map) = self { map.len() } else { 0 }
    }
}

impl<'a> From<&'a StoredMap> for Scene<'a> {
    fn from(map: &'a StoredMap) -> Self {
        match map {
            StoredMap::Gaussians(map) => Self::Gaussians(map),
            StoredMap::Field(map) => Self::Field(map),
        }
    }
}
