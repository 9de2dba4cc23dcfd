//! Files of Gaussians as splat viewers read and write them.
//!
//! The form is that of Kerbl et al. 2023: a PLY file with one vertex per Gaussian and the properties `x y z`,
//! `f_dc_0..2` (spherical harmonics of degree 0 of the display colour), `opacity` (logit), `scale_0..2` (natural
//! logarithms) and `rot_0..3` (w x y z). Maps hold linear light: colours are converted on the way.

mod read;
mod write;

pub use mba_io::ply::PlyError;
pub use read::{parse_ply, read_ply};
pub use write::{format_ply, write_ply};

use super::store::PARAMETERS;

/// Names of the properties in the order of the planes of a map.
const NAMES: [&str; PARAMETERS] = [
    "x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0",
    "f_dc_1", "f_dc_2",
];
