//! Fixed-seed inputs shared by the benchmarks.

pub mod bundle;
pub mod exposure;
pub mod field;
pub mod raster;
pub mod recording;
pub mod ssim;
pub mod transfer;
