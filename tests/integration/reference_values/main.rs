//! The tracker against published formulas evaluated with 60 decimal digits.

mod geometry;
mod transfer;
