//! Losses of rendered exposures against what was captured, with their gradients by the pixels.

mod exposure;
mod image_loss;
mod ssim;

pub use exposure::{Exposure, ExposureLoss};
pub use image_loss::{CLIPPED, DisplayPlanes, NOISE, compare_depth, smooth_absolute};
pub use image_loss::{LossTerms, LossWeights};
pub use ssim::Ssim;
pub use ssim::{WINDOW, mean_ssim};
