//! The Gaussian rasterizer against golden data, its oracle, finite differences and hostile input.

mod golden;
mod reference;
