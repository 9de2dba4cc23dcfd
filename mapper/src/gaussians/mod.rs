//! The map: 3D Gaussians and their files.

mod store;

pub use store::{
    COLOUR, Gaussian, Gaussians, LOG_SCALE, MEAN, OPACITY_LOGIT, PARAMETERS, PlanesMut, ROTATION,
};
