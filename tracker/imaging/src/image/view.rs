//! Borrowed input images with a row stride.

use core::fmt;

/// A buffer is too short for the size and stride of its image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExtentError {
    /// Values needed.
    pub needed: usize,
    /// Values present.
    pub got: usize,
}

impl fmt::Display for ExtentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "image buffer holds {} values, {} are needed", self.got, self.needed)
    }
}

impl core::error::Error for ExtentError {}

/// Layout of a colour pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelFormat {
    /// One byte per pixel.
    Grey8,
    /// Three bytes per pixel: red, green, blue.
    Rgb8,
}

impl PixelFormat {
    /// Bytes per pixel.
    #[must_use]
    #[inline]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Grey8 => 1,
            Self::Rgb8 => 3,
        }
    }
}

/// An 8-bit image as the camera delivers it: encoded by the camera's response, undistorted.
#[derive(Clone, Copy, Debug)]
pub struct ColourView<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
    format: PixelFormat,
}

impl<'a> ColourView<'a> {
    /// A view of `height` rows that start `stride` bytes apart.
    ///
    /// # Errors
    /// [`ExtentError`] when a row is longer than the stride or the last row is not complete.
    pub fn new(
        data: &'a [u8],
        width: usize,
        height: usize,
        stride: usize,
        format: PixelFormat,
    ) -> Result<Self, ExtentError> {
        let row = width.saturating_mul(format.bytes());
        check_extent(data.len(), row, height, stride)?;
        Ok(Self { data, width, height, stride, format })
    }

    /// Columns and rows.
    #[must_use]
    #[inline]
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Layout of a pixel.
    #[must_use]
    #[inline]
    pub fn format(&self) -> PixelFormat {
        self.format
    }

    /// The bytes of row `v`.
    #[must_use]
    #[inline]
    pub fn row(&self, v: usize) -> &'a [u8] {
        &self.data[v * self.stride..][..self.width * self.format.bytes()]
    }
}

/// A 16-bit depth image, z along the optical axis in raw units; 0 is missing.
#[derive(Clone, Copy, Debug)]
pub struct DepthView<'a> {
    data: &'a [u16],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> DepthView<'a> {
    /// A view of `height` rows that start `stride` values apart.
    ///
    /// # Errors
    /// [`ExtentError`] when a row is longer than the stride or the last row is not complete.
    pub fn new(data: &'a [u16], width: usize, height: usize, stride: usize) -> Result<Self, ExtentError> {
        check_extent(data.len(), width, height, stride)?;
        Ok(Self { data, width, height, stride })
    }

    /// Columns and rows.
    #[must_use]
    #[inline]
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The raw values of row `v`.
    #[must_use]
    #[inline]
    pub fn row(&self, v: usize) -> &'a [u16] {
        &self.data[v * self.stride..][..self.width]
    }
}

fn check_extent(len: usize, row: usize, height: usize, stride: usize) -> Result<(), ExtentError> {
    let needed = match height {
        0 => 0,
        _ => (height - 1).saturating_mul(stride).saturating_add(row),
    };
    if row > stride || len < needed {
        return Err(ExtentError { needed: needed.max(row), got: len });
    }
    Ok(())
}
