//! Differentiable rasterizer for 3D Gaussians (Kerbl et al. 2023) on a CPU.
//!
//! Colour, depth and alpha of a view, and the gradients of a loss on them by every parameter of the Gaussians and
//! by the pose of the camera. Gaussians are projected with the local affine approximation (Zwicker et al. 2001,
//! EWA splatting), sorted by the camera z of their centres, ties by index, and composited front to back.

pub mod constants;
pub mod pose;
pub mod reference;
mod view;

pub use view::RasterView;
