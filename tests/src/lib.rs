//! Helpers shared by the whole-system tests.

pub mod small_dataset;
pub mod transfer_scene;
