//! `#[serde(with = "exact_floats")]` for a `Vec<f32>`: stored as bytes, every bit kept, NaN payloads too.

use std::fmt;

use serde::de::{Deserializer, Error, Visitor};
use serde::ser::Serializer;

/// Writes the little-endian bytes of all values.
///
/// # Errors
/// Those of the serializer.
pub fn serialize<S: Serializer>(
    values: &(impl AsRef<[f32]> + ?Sized),
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let values = values.as_ref();
    let mut bytes = vec![0; size_of_val(values)];
    for (place, value) in bytes.chunks_exact_mut(4).zip(values) {
        place.copy_from_slice(&value.to_le_bytes());
    }
    serializer.serialize_bytes(&bytes)
}

/// The inverse of [`serialize`].
///
/// # Errors
/// Those of the deserializer, or if the number of bytes is not a multiple of four.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f32>, D::Error> {
    deserializer.deserialize_bytes(Bytes)
}

struct Bytes;

impl Visitor<'_> for Bytes {
    type Value = Vec<f32>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the bytes of f32 values")
    }

    fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Self::Value, E> {
        match bytes.as_chunks::<4>() {
            (values, []) => Ok(values.iter().map(|value| f32::from_le_bytes(*value)).collect()),
            _ => Err(E::invalid_length(bytes.len(), &self)),
        }
    }
}
