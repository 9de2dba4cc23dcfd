//! Fixed-seed inputs shared by the benchmarks.

pub mod transfer;
