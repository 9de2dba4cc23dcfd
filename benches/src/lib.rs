//! Fixed-seed inputs shared by the benchmarks.

pub mod recording;
pub mod transfer;
