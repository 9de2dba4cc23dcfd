//! Helpers shared by the whole-system tests.

pub mod raster_golden;
pub mod raster_scene;
pub mod reference_values;
pub mod transfer_scene;
