//! What all PLY files have in common: header and records, in ascii or little-endian.

mod error;
mod header;
mod records;

/// What every PLY file starts with.
pub const MAGIC: &[u8] = b"ply";

pub use error::PlyError;
pub use header::{Element, Header};
pub use records::Records;
