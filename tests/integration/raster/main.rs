//! The Gaussian rasterizer against golden data, its oracle, finite differences and hostile input.

mod golden;
mod ply;
mod reference;
