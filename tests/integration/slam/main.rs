//! Tracking and mapping at the same time.

mod loops;
mod quality;
mod stream;
