//! Differentiable rasterizer for 3D Gaussians (Kerbl et al. 2023) on a CPU.
//!
//! Colour, depth and alpha of a view, and the gradients of a loss on them by every parameter of the Gaussians and
//! by the pose of the camera. Gaussians are projected with the local affine approximation (Zwicker et al. 2001,
//! EWA splatting), sorted by the camera z of their centres, ties by index, and composited front to back.
//!
//! The depth of a Gaussian at a pixel is where the ray of the pixel meets the peak of its density, as in RaDe-GS (Zhang et
//! al. 2024), linear in the offset from its projected centre. With the depth of the centres, overlapping splats of a
//! slanted surface would be composited nearer than that surface, because the nearer centre is in front.
//!
//! Stages, one file each: [`Rasterizer::forward`] projects, orders, bins and composites; [`ViewTape::backward`]
//! replays the pixels, reduces over tiles and projects back. Only the drivers know about threads; the results do not
//! depend on their number. [`mod@reference`] is the slow oracle.

mod backward;
mod bands;
mod bin;
pub mod constants;
mod driver;
pub mod exp;
mod falloff;
mod forward;
mod image;
mod lanes;
mod order;
pub mod pose;
mod project;
mod project_backward;
mod reduce;
pub mod reference;
mod tape;
mod tile;
mod view;
mod view_share;

pub(crate) use bands::BandView;
pub(crate) use driver::PoseSums;
pub use driver::{GaussianGradients, RasterScratch, Rasterizer};
pub use image::RasterImage;
pub use tape::ViewTape;
pub(crate) use tile::TILE_HEIGHT;
pub use view::RasterView;
pub(crate) use view_share::{ColourShare, ViewShare};
