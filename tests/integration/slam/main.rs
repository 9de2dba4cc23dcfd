//! Tracking and mapping at the same time.

mod field;
mod loops;
mod quality;
mod resume;
mod stream;
