//! What becomes of stored images before they are those of the calibration's camera.

use std::io;
use std::path::Path;

use mba_tracker::SimdLevel;
use mba_tracker::geometry::PinholeCamera;
use mba_tracker::image::{
    PixelRectangle, SourcePosition, fill_source_map, region_with_source, remap_bilinear, remap_nearest,
};

use super::depth_view::DepthView;
use super::{Calibration, DepthCamera, FrameReadError};

/// Size of the stored colour images and, unless they are used as they are, how to resample them.
#[derive(Clone, Debug)]
pub(super) struct ColourSource {
    pub(super) size: (usize, usize),
    pub(super) map: Option<Vec<SourcePosition>>,
    /// Whether there was any image when the data set was opened. Without one the size is a mere claim, for which no map is
    /// made.
    pub(super) is_there: bool,
}

/// The same of the depth images.
#[derive(Clone, Debug)]
pub(super) struct DepthSource {
    pub(super) size: (usize, usize),
    view: DepthView,
    pub(super) is_there: bool,
}

impl ColourSource {
    pub(super) fn new(calibration: &Calibration, captured: &PinholeCamera, is_there: bool) -> Self {
        let size = size(captured);
        let map = is_there.then(|| undistortion(calibration, captured)).flatten();
        Self { size, map, is_there }
    }

    /// The rectangle of the frames of a camera in which every pixel has a source.
    pub(super) fn region(&self, camera: &PinholeCamera) -> PixelRectangle {
        let whole = PixelRectangle { left: 0, top: 0, right: camera.width, bottom: camera.height };
        self.map.as_ref().map_or(whole, |map| region_with_source(map, camera.width))
    }

    pub(super) fn undistort(&self, simd: SimdLevel, stored: Vec<u8>) -> Vec<u8> {
        let Some(map) = &self.map else { return stored };
        let mut target = vec![[0; 3]; map.len()];
        let (pixels, _) = stored.as_chunks::<3>();
        let mapped = remap_bilinear(simd, pixels, self.size.0, self.size.1, map, &mut target);
        debug_assert_eq!(mapped, Ok(()), "the decoder checked the size");
        target.into_flattened()
    }

    /// Which pixels of the frame are used, of a stored mask.
    pub(super) fn undistort_mask(&self, simd: SimdLevel, stored: Vec<u16>) -> Vec<u16> {
        let Some(map) = &self.map else { return stored };
        let mut target = vec![0; map.len()];
        let mapped = remap_nearest(simd, &stored, self.size.0, self.size.1, map, &mut target);
        debug_assert_eq!(mapped, Ok(()), "the decoder checked the size");
        target
    }
}

impl DepthSource {
    /// Depth images of a camera of their own, or else registered to the camera of the calibration.
    pub(super) fn new(calibration: &Calibration, own: Option<&DepthCamera>, is_there: bool) -> Self {
        let camera = &calibration.camera;
        let view = match own {
            _ if !is_there => DepthView::Stored,
            Some(own) => DepthView::of(own, camera, calibration.depth_scale),
            None => undistortion(calibration, camera).map_or(DepthView::Stored, DepthView::Nearest),
        };
        Self { size: size(own.map_or(camera, |own| &own.camera)), view, is_there }
    }

    /// The depth of the frame's pixels.
    pub(super) fn seen(&self, simd: SimdLevel, stored: Vec<u16>) -> Vec<u16> {
        self.view.seen(simd, stored, self.size)
    }
}

/// Refuses an image that has come since the data set was opened: there may be no map for it.
pub(super) fn check_is_there(is_there: bool, path: &Path) -> Result<(), FrameReadError> {
    if is_there || !path.is_file() {
        return Ok(());
    }
    let reason = io::Error::other("no such image could be read when the data set was opened");
    Err(FrameReadError::Unreadable { path: path.to_owned(), reason })
}

/// Where the pixels of the calibration's camera are in images of `captured`, which have its distortion; none where they
/// are the same.
fn undistortion(calibration: &Calibration, captured: &PinholeCamera) -> Option<Vec<SourcePosition>> {
    let ideal = &calibration.camera;
    if calibration.distortion.is_none() && captured == ideal {
        return None;
    }
    let mut map = vec![[0.0; 2]; ideal.width * ideal.height];
    let filled = fill_source_map(ideal, captured, &calibration.distortion, &mut map);
    filled.ok().map(|()| map)
}

/// Columns and rows.
pub(super) fn size(camera: &PinholeCamera) -> (usize, usize) {
    (camera.width, camera.height)
}
