//! The second kind of map: a field of signed distance and colour on three axis-aligned planes.

mod adam;
mod chunk;
mod decode;
mod decode_backward;
mod encode;
mod engine;
mod field;
mod gradients;
mod layers;
mod map_file;
mod march;
mod opacity;
mod planes;
mod prepared;
mod query;
#[cfg(test)]
mod reference;
mod region;
mod render;
mod sampling;
mod settings;

pub use adam::{FieldStep, TriplaneAdam};
pub use engine::{FieldExposure, FieldWeights, TriplaneEngine};
pub use field::TriplaneField;
pub use gradients::FieldGradients;
pub use map_file::{FieldFileError, read_field, write_field};
pub use region::Region;
pub use render::FieldRenderer;
pub use sampling::SamplingSettings;
pub use settings::{CHANNELS, COARSE_CELL, FEATURES, FieldSettings, HIDDEN, MOST_REFINEMENT};
