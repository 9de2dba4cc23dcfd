//! Losses on rendered images, with their gradients by the pixels.

mod ssim;

pub use ssim::Ssim;
