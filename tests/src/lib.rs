//! Helpers shared by the whole-system tests.

pub mod blurred_sequence;
pub mod handheld;
pub mod plane_scene;
pub mod raster_golden;
pub mod raster_scene;
pub mod reference_values;
pub mod small_dataset;
pub mod still_run;
pub mod transfer_scene;
pub mod tree;
