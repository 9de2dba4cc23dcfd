//! Gaussians and their rasterizer, views along the path of an exposure, and losses against what was captured.
//!
//! A step of a map goes through these modules: [`exposure`] renders the views of an exposure with [`raster`], [`losses`] compares
//! their mean with an observation of [`sensor`], and gradients come back to [`gaussians`] and to the path.

pub mod exposure;
pub mod gaussians;
pub mod losses;
pub mod raster;
pub mod sensor;
