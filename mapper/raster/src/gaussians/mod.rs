//! The map: 3D Gaussians and their files.

mod display_colour;
mod ply;
mod store;

pub use ply::{PlyError, format_ply, parse_ply, read_ply, write_ply};
pub use store::{
    COLOUR, Gaussian, Gaussians, LOG_SCALE, MEAN, OPACITY_LOGIT, PARAMETERS, PlanesMut, ROTATION,
};
