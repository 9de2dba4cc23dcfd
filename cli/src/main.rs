//! The `mba` program.

fn main() {}
