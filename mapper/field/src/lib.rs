//! The map that is a tri-plane field of signed distance and colour: rendering, losses with gradients, its optimiser and its file.

pub mod triplane;
