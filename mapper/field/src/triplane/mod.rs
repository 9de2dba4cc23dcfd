//! The second kind of map: a field of signed distance and colour (MBA-SLAM section 3.4, after ESLAM).
//!
//! Features lie on the nodes of axis-aligned planes at two resolutions, one set for geometry and one for colour. The
//! feature of a point is the sum of bilinear look-ups in three planes; two small decoders make signed distance and
//! colour of it. A ray adds up its samples with weights that follow from the distances, and a blurred pixel is the mean
//! in linear light of its rays in all virtual views.
//!
//! [`FieldLoss`] compares some pixels of an exposure with what was captured and takes the gradient back to planes,
//! decoders, sharpness, gain and the path of the camera. Rays are sampled where a surface is expected: around the
//! measured depth at mid exposure, around where that surface lies in the other virtual views, and around what the field
//! itself has where nothing was measured. [`TriplaneAdam`] moves what was seen. [`FieldRenderer`] makes views,
//! [`TriplaneField::distances`] tells where surfaces are, and [`write_field`] keeps the map.

mod adam;
mod cells;
mod chunk;
mod decode;
mod decode_backward;
mod encode;
mod field;
mod field_loss;
mod gradients;
mod layers;
mod map_file;
mod march;
mod opacity;
mod planes;
mod prefetch;
mod prepared;
mod query;
mod ray_views;
#[cfg(test)]
mod reference;
mod region;
mod render;
mod sampling;
mod scatter;
mod settings;
mod weights;

pub use adam::{FieldStep, TriplaneAdam};
pub use field::TriplaneField;
pub use field_loss::{FieldExposure, FieldLoss};
pub use gradients::FieldGradients;
pub use map_file::{FieldFileError, read_field, write_field};
pub use region::Region;
pub use render::FieldRenderer;
pub use sampling::SamplingSettings;
pub use settings::{CHANNELS, COARSE_CELL, FEATURES, FieldSettings, HIDDEN, MOST_REFINEMENT};
pub use weights::FieldWeights;
