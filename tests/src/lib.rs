//! Helpers shared by the whole-system tests.

pub mod transfer_scene;
