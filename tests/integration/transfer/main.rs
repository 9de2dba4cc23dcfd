//! Pixel transfer: every SIMD level against the scalar oracle, derivatives, and published reference values.

mod derivatives;
mod levels;
mod rows;
