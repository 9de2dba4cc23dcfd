//! Losses on rendered images, with their gradients by the pixels.

mod ssim;

pub use ssim::Ssim;
pub(crate) use ssim::{WINDOW, mean_ssim};
