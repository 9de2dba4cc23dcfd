//! Tracking and mapping at the same time.

mod field;
mod localise;
mod loops;
mod quality;
mod resume;
mod stream;
