//! How alike two images are.

use mba_raster::losses::{WINDOW, mean_ssim};

/// Why two images cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The images have different numbers of values.
    #[error("the images have {reference} and {estimate} values")]
    SizesDiffer {
        /// Values of the reference.
        reference: usize,
        /// Values of the estimate.
        estimate: usize,
    },
    /// The images have no values.
    #[error("the images are empty")]
    Empty,
    /// An image has no window of the structural similarity.
    #[error("the images have {width} x {height} pixels; {WINDOW} x {WINDOW} are the least")]
    TooSmall {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The images do not have the number of values that their size asks for.
    #[error("the images have {values} values, not three for each of {width} x {height} pixels")]
    NotThatSize {
        /// Values of each image.
        values: usize,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
}

/// Peak signal-to-noise ratio in dB over all values of two 8-bit images, with 255 as the peak: infinite for equal
/// images. For images encoded for display, as files are, it is the ratio of display values, not of linear light.
///
/// # Errors
/// [`ImageError`] when the images have no or different numbers of values.
pub fn psnr(reference: &[u8], estimate: &[u8]) -> Result<f64, ImageError> {
    check_lengths(reference.len(), estimate.len())?;
    let squares: u64 = reference.iter().zip(estimate).map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2)).sum();
    let mean_square = squares as f64 / reference.len() as f64;
    Ok(10.0 * (255.0 * 255.0 / mean_square).log10())
}

/// Mean structural similarity (Wang et al. 2004) of two 8-bit images of `[width, height]` pixels, bytes R, G, B per
/// pixel, row by row: the mean over channels and over the windows of 11x11 pixels inside the image, at most 1.
///
/// The figure is that of scikit-image's `structural_similarity` with `channel_axis=2, gaussian_weights=True,
/// sigma=1.5, use_sample_covariance=False, data_range=255`.
///
/// # Errors
/// [`ImageError`] when the images differ in size or have no window.
pub fn ssim(size: [usize; 2], reference: &[u8], estimate: &[u8]) -> Result<f64, ImageError> {
    let [width, height] = size;
    check_lengths(reference.len(), estimate.len())?;
    if width < WINDOW || height < WINDOW {
        return Err(ImageError::TooSmall { width, height });
    }
    let values = reference.len();
    if width.checked_mul(height).and_then(|pixels| pixels.checked_mul(3)) != Some(values) {
        return Err(ImageError::NotThatSize { values, width, height });
    }
    let similarity = |channel| {
        let plane = |image: &[u8]| -> Vec<f64> {
            image.iter().skip(channel).step_by(3).map(|&value| f64::from(value)).collect()
        };
        mean_ssim(size, &plane(reference), &plane(estimate), 255.0)
    };
    Ok((0..3).map(similarity).sum::<f64>() / 3.0)
}

/// How far two depth maps are apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthDifference {
    /// Mean absolute difference in metres over the pixels that have depth in both; zero if there are none.
    pub l1: f64,
    /// Share of all pixels that have depth in both, in `[0, 1]`.
    pub share: f64,
}

/// Compares two depth maps in metres; depth that is not positive or not finite is missing.
///
/// # Errors
/// [`ImageError`] when the maps have no or different numbers of values.
pub fn depth_difference(reference: &[f64], estimate: &[f64]) -> Result<DepthDifference, ImageError> {
    check_lengths(reference.len(), estimate.len())?;
    let is_depth = |depth: f64| depth > 0.0 && depth.is_finite();
    let both = reference.iter().zip(estimate).filter(|(a, b)| is_depth(**a) && is_depth(**b));
    let (count, sum) = both.fold((0_u64, 0.0), |(count, sum), (a, b)| (count + 1, sum + (a - b).abs()));
    Ok(DepthDifference { l1: sum / count.max(1) as f64, share: count as f64 / reference.len() as f64 })
}

fn check_lengths(reference: usize, estimate: usize) -> Result<(), ImageError> {
    match reference == estimate {
        false => Err(ImageError::SizesDiffer { reference, estimate }),
        true if reference == 0 => Err(ImageError::Empty),
        true => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_differences_have_known_ratios() {
        // Mean square 25.5^2 is a hundredth of the peak's; one of four values off by 51 has the same mean square.
        assert!((psnr(&[10, 20, 30, 255], &[61, 20, 30, 255]).unwrap() - 20.0).abs() < 1e-9);
        assert_eq!(psnr(&[0], &[255]), Ok(0.0));
        assert_eq!(psnr(&[7, 8], &[7, 8]), Ok(f64::INFINITY));
    }

    #[test]
    fn images_of_different_size_are_refused() {
        assert_eq!(psnr(&[1, 2], &[1]), Err(ImageError::SizesDiffer { reference: 2, estimate: 1 }));
        assert_eq!(psnr(&[], &[]), Err(ImageError::Empty));
    }
    #[test]
    fn flat_images_differ_by_their_means() {
        // Without variance only the term of the means is left: (2 a b + c)/(a^2 + b^2 + c), c = 2.55^2.
        let (a, b, c) = (100.0, 150.0, 2.55_f64.powi(2));
        let expected = (2.0 * a * b + c) / (a * a + b * b + c);
        let found = ssim([13, 12], &[100; 468], &[150; 468]).unwrap();
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        assert_eq!(ssim([13, 12], &[100; 468], &[100; 468]), Ok(1.0));
    }

    #[test]
    fn images_without_a_window_are_refused() {
        let error = ImageError::TooSmall { width: 10, height: 12 };
        assert_eq!(ssim([10, 12], &[0; 360], &[0; 360]), Err(error));
        let error = ImageError::NotThatSize { values: 360, width: 11, height: 11 };
        assert_eq!(ssim([11, 11], &[0; 360], &[0; 360]), Err(error));
    }

    #[test]
    fn depth_is_compared_where_both_have_it() {
        let difference = depth_difference(&[1.0, 0.0, 2.0, 3.0], &[1.5, 9.0, 1.0, f64::NAN]);
        assert_eq!(difference, Ok(DepthDifference { l1: 0.75, share: 0.5 }));
        let nothing = depth_difference(&[0.0, 1.0], &[1.0, 0.0]);
        assert_eq!(nothing, Ok(DepthDifference { l1: 0.0, share: 0.0 }));
    }
}
