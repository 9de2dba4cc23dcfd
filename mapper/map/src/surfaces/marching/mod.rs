//! Marching cubes (Lorensen and Cline 1987): triangles where a signed distance on a grid changes its sign.
//!
//! Boxes of samples are independent of each other, so that threads may share them; an [`Assembly`] joins their pieces
//! in a fixed order. Boxes overlap in their outermost layer of points and must have the same samples there.

mod assembly;
mod piece;
mod table;

pub(super) use assembly::{Assembly, Lattice};
pub(super) use piece::{Piece, SampleBox};
