//! Fixed-seed inputs shared by the benchmarks.
