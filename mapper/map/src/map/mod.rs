//! Maps of every kind: what they are, their files, and views of them.
//!
//! A [`Scene`] is a map to look at, a [`StoredMap`] one that was read from its file.

mod kind;
mod scene;
mod stored;

pub use kind::{MapKind, MapSize};
pub use scene::{RenderedMap, Scene, SceneRenderer};
pub use stored::{MapFileError, StoredMap};

/// Name of the file of a map of Gaussians.
pub const MAP_FILE: &str = "map.ply";
/// Name of the file of a map that is a tri-plane field.
pub const FIELD_FILE: &str = "map.mbaf";
