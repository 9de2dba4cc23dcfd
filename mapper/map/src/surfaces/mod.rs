//! Surfaces of maps as meshes.
//!
//! A [`Mesh`] comes from what cameras see of a map ([`ViewSource`], for Gaussians [`MapViews`]) by [`fuse_views`], or
//! from a signed distance that is known everywhere by [`mesh_from_field`]. [`Sight`] drops what no camera has seen and
//! gives colours to the rest; [`surface_of_views`] does all of that, and [`surface_of_field`] for a tri-plane field.

mod components;
mod error;
mod field;
mod map_views;
mod marching;
mod of_field;
mod sampling;
mod sight;
mod tsdf;
mod view;

pub use error::SurfaceError;
pub use field::{FieldBox, mesh_from_field};
pub use map_views::MapViews;
use mba_mesh::Mesh;
pub use of_field::surface_of_field;
pub use sampling::sample_surface;
pub use sight::{Sight, Trim};
pub use tsdf::{FusionSettings, fuse_views};
pub use view::{ColouredDepth, ViewSource};

use mba_tracker::SimdLevel;

use crate::map::Scene;

/// The coloured surface of a map that views of it show, with voxels of `settings.voxel`: a field's is where its distance
/// is zero, that of other maps is fused from the views. Without parts of less than `trim.least_area`. A field is asked with
/// the instructions `simd`.
///
/// # Errors
/// See [`fuse_views`] and [`surface_of_field`].
pub fn surface_of_map(
    simd: SimdLevel,
    map: Scene<'_>,
    source: &mut dyn ViewSource,
    settings: &FusionSettings,
    trim: &Trim,
) -> Result<Mesh, SurfaceError> {
    match map {
        Scene::Gaussians(_) | Scene::Other(_) => surface_of_views(source, settings, trim),
        Scene::Field(field) => surface_of_field(simd, field, settings.voxel, source, trim),
    }
}

/// How often [`surface_of_map`] asks for every view.
#[must_use]
pub fn passes(map: Scene<'_>) -> usize {
    match map {
        Scene::Gaussians(_) | Scene::Other(_) => 3,
        Scene::Field(_) => 1,
    }
}

/// The coloured surface that views show: fused, trimmed to what they see, without parts of less than
/// `trim.least_area`.
///
/// # Errors
/// See [`fuse_views`].
pub fn surface_of_views(
    source: &mut dyn ViewSource,
    settings: &FusionSettings,
    trim: &Trim,
) -> Result<Mesh, SurfaceError> {
    let mesh = fuse_views(source, settings)?;
    let mut sight = Sight::new(&mesh);
    for index in 0..source.count() {
        sight.look(&mesh, &source.view(index), settings.truncation());
    }
    Ok(sight.trim(&mesh, trim))
}
