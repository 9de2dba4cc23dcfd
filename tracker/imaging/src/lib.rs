//! How a moving RGB-D camera makes its images: what a tracker has to know of cameras, motion, light and surfaces.
//!
//! `no_std`, no heap. Conventions are those of the tracker: camera frame x right, y down, z forward; the centre of the
//! top-left pixel is `(0, 0)`; poses are named after what they map (`reference_from_camera`); tangent vectors are
//! `(translation in the reference frame, rotation in the camera frame)`; light is linear in `[0, 1]`; depth is z in
//! metres; `s = 0` at shutter opening, `s = 1` at closing.
//!
//! # Layers
//!
//! A module uses only those to its left: [`math`], [`geometry`], [`trajectory`], [`photometric`], [`image`],
//! [`surface`], [`transfer`]. Beside them, [`simd`] chooses the instruction set and [`workspace`] hands out the
//! caller's memory.
//!
//! # Features
//!
//! * `std` (default): `SimdLevel::new()` asks the operating system for the best instruction set. Without it,
//!   `SimdLevel::baseline()` takes what the target was compiled for.
//! * `scalar`: kernels without vector instructions on every target, for tests.
#![no_std]
#![deny(unsafe_code)]

#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod geometry;
pub mod image;
pub mod math;
pub mod photometric;
pub mod simd;
pub mod surface;
pub mod trajectory;
pub mod transfer;
pub mod workspace;
