//! Plain scalar twins of the SIMD kernels: the oracle that every SIMD level is tested against. Kept for good.

mod patch;
mod photometric;

pub use patch::{MIN_PLANE_DISTANCE, MIN_RAY_Z, Transferred, patch_rows, patch_values, sample};
pub use photometric::{evaluate_cost, linearize};
