//! Rotations, rigid transforms and the pinhole camera, in f64.

mod camera;
mod rigid;
pub mod so3;

pub use camera::{Distortion, PinholeCamera};
pub use rigid::RigidTransform;
