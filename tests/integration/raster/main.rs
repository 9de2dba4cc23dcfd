//! The Gaussian rasterizer against golden data, its oracle, finite differences and hostile input.

mod depth;
mod derivatives;
mod exposure;
mod golden;
mod levels;
mod misuse;
mod ply;
mod poison;
mod reference;
mod rolling;
mod threads;
