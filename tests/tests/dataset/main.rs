//! Data sets: every layout, every message.

mod bad_input;
mod folder;
mod other_layouts;
mod tum_layout;
