//! Views of a map as image files.

mod view;

pub use view::{RenderedView, SOLID_ALPHA, ViewRenderer};
