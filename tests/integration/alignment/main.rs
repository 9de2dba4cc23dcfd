//! The depth term and the whole alignment on rendered pairs of views.

mod depth_term;
mod exposure;
mod pair;
