//! Those helpers of `mba-tests` that need nothing but the tracker.

#[path = "../../src/handheld.rs"]
pub mod handheld;
#[path = "../../src/plane_scene.rs"]
pub mod plane_scene;
#[path = "../../src/transfer_scene.rs"]
pub mod transfer_scene;
