//! Files of Gaussians as splat viewers read and write them.
//!
//! The form is that of Kerbl et al. 2023: a PLY file with one vertex per Gaussian and the properties `x y z`,
//! `f_dc_0..2` (spherical harmonics of degree 0 of the display colour), `opacity` (logit), `scale_0..2` (natural
//! logarithms) and `rot_0..3` (w x y z). Maps hold linear light: colours are converted on the way.
//!
//! Viewers blend the display values of `f_dc`, maps are blended in linear light: the same colours cannot suit both. A file
//! [for viewers](format_ply_for_viewers) has in `f_dc` and `scale` what suits viewers, and those of the map, in the same form,
//! in the properties `mba_dc_0..2` and `mba_scale_0..2` behind all others, which viewers pass over. Where a file has these,
//! they are what is read.

mod read;
mod write;

pub use mba_io::ply::PlyError;
pub use read::{parse_ply, read_ply};
pub use write::{ForViewers, format_ply, format_ply_for_viewers, write_ply, write_ply_for_viewers};

use super::store::PARAMETERS;

/// Names of the properties with colours and sizes of the map, in a file whose `f_dc` and `scale` are for viewers.
const MAP_NAMES: [&str; 6] =
    ["mba_dc_0", "mba_dc_1", "mba_dc_2", "mba_scale_0", "mba_scale_1", "mba_scale_2"];

/// Names of the properties in the order of the planes of a map.
const NAMES: [&str; PARAMETERS] = [
    "x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0",
    "f_dc_1", "f_dc_2",
];
