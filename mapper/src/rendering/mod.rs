//! Views of a map as image files.

mod scene;
mod view;

pub use scene::{Scene, SceneRenderer};
pub use view::{Behind, RenderedView, SOLID_ALPHA, ViewRenderer};
