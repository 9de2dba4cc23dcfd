//! How alike two images are.

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
}

/// Peak signal-to-noise ratio in dB over all values of two 8-bit images, with 255 as the peak: infinite for equal
/// images. For images encoded for display, as files are, it is the ratio of display values, not of linear light.
///
/// # Errors
/// [`ImageError`] when the images have no or different numbers of values.
pub fn psnr(reference: &[u8], estimate: &[u8]) -> Result<f64, ImageError> {
    if reference.len() != estimate.len() {
        return Err(ImageError::SizesDiffer { reference: reference.len(), estimate: estimate.len() });
    }
    if reference.is_empty() {
        return Err(ImageError::Empty);
    }
    let squares: u64 = reference.iter().zip(estimate).map(|(a, b)| u64::from(a.abs_diff(*b)).pow(2)).sum();
    let mean_square = squares as f64 / reference.len() as f64;
    Ok(10.0 * (255.0 * 255.0 / mean_square).log10())
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
}
