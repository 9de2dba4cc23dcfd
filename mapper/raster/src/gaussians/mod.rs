//! The map: 3D Gaussians and their files.

mod display_colour;
mod ply;
mod store;

pub use ply::{
    ForViewers, PlyError, format_ply, format_ply_for_viewers, parse_ply, read_ply, write_ply,
    write_ply_for_viewers,
};
pub use store::{
    COLOUR, Gaussian, Gaussians, LOG_SCALE, MEAN, OPACITY_LOGIT, PARAMETERS, PlanesMut, ROTATION,
};
