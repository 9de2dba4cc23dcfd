//! Views of a map as image files.

mod view;

pub use view::{Behind, RenderedView, SOLID_ALPHA, ViewRenderer};
