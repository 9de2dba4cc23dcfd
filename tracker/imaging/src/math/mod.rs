//! Scalar functions that `core` does not offer without an operating system, and small solvers.

mod scalar;

pub use scalar::*;
