//! Colour and depth of the frames that are exported.

use std::path::{Path, PathBuf};

use mba_io::dataset::{Dataset, FrameReadError, read_image};
use mba_tracker::geometry::PinholeCamera;

use super::{DEPTH_UNIT, ExportError, PosedFrame};
use crate::run::{DEPTH_FOLDER, Run, RunCamera, deblurred_path};

/// Largest difference between the times of a frame in the run and in the data set, seconds.
const SAME_TIME: f64 = 1e-4;

/// Largest difference between the intrinsics of the run and of the data set, pixels. Both come from one file.
const SAME_CAMERA: f64 = 1e-6;

/// What is exported of a frame.
pub(super) struct FrameImages {
    /// Red, green and blue of each pixel, row-major.
    pub(super) rgb: Vec<u8>,
    /// Depth along the optical axis in millimetres, row-major; 0 is missing. Empty where it was not asked for.
    pub(super) depth: Vec<u16>,
}

/// Where a run keeps the depth of a keyframe.
fn depth_path(folder: &Path, index: usize) -> PathBuf {
    folder.join(DEPTH_FOLDER).join(format!("{index:06}.png"))
}

/// Reads images: deblurred keyframes and their depth from the run where it has them, all else from the data set.
pub(super) struct ImageReader<'a> {
    pub(super) run: &'a Run,
    pub(super) camera: &'a RunCamera,
    pub(super) dataset: Option<&'a Dataset>,
    pub(super) with_depth: bool,
}

impl ImageReader<'_> {
    /// Whether a frame is not all in the run.
    pub(super) fn needs_data_set(&self, frame: &PosedFrame) -> bool {
        let (index, folder) = (frame.index, &self.run.folder);
        let is_deblurred = frame.is_keyframe && deblurred_path(folder, index).is_file();
        !is_deblurred || self.with_depth && !depth_path(folder, index).is_file()
    }

    /// The images of a frame.
    pub(super) fn read(&self, frame: &PosedFrame) -> Result<FrameImages, ExportError> {
        let (index, folder) = (frame.index, &self.run.folder);
        let [colour, depth] = [deblurred_path(folder, index), depth_path(folder, index)];
        let rgb = if frame.is_keyframe && colour.is_file() { Some(self.colour(&colour)?) } else { None };
        // The depth of a map belongs to its own view of the keyframe.
        let has_depth = self.with_depth && rgb.is_some() && depth.is_file();
        let depth = if has_depth { Some(self.depth(&depth)?) } else { None };
        match (rgb, depth) {
            (Some(rgb), Some(depth)) => Ok(FrameImages { rgb, depth }),
            (Some(rgb), None) if !self.with_depth => Ok(FrameImages { rgb, depth: Vec::new() }),
            (rgb, _) => {
                let dataset = self.dataset.ok_or(ExportError::NoDataSet { index })?;
                let captured = dataset.frame(index)?;
                let depth = self.in_millimetres(captured.depth);
                Ok(FrameImages { rgb: rgb.unwrap_or(captured.rgb), depth })
            }
        }
    }

    fn colour(&self, path: &Path) -> Result<Vec<u8>, ExportError> {
        let image = read_image(path)?.into_rgb8();
        self.check_size(path, [image.width(), image.height()])?;
        Ok(image.into_raw())
    }

    fn depth(&self, path: &Path) -> Result<Vec<u16>, ExportError> {
        let image = read_image(path)?;
        let Some(image) = image.as_luma16() else {
            let found = format!("{:?}", image.color());
            return Err(FrameReadError::DepthFormat { path: path.to_owned(), found }.into());
        };
        self.check_size(path, [image.width(), image.height()])?;
        Ok(self.in_millimetres(image.as_raw().clone()))
    }

    fn check_size(&self, path: &Path, found: [u32; 2]) -> Result<(), ExportError> {
        let (found, expected) = (found.map(|size| size as usize), [self.camera.width, self.camera.height]);
        if found == expected {
            return Ok(());
        }
        Err(ExportError::Size { path: path.to_owned(), found, expected })
    }

    /// Raw depth in millimetres; what is too far for 16 bits is missing.
    fn in_millimetres(&self, mut depth: Vec<u16>) -> Vec<u16> {
        let factor = 1.0 / (self.camera.depth_scale * DEPTH_UNIT);
        for value in &mut depth {
            let millimetres = (f64::from(*value) * factor).round();
            *value = if millimetres <= f64::from(u16::MAX) { millimetres as u16 } else { 0 };
        }
        depth
    }
}

/// Whether a data set is that of a run: the same camera, and the same times of the frames that are exported.
pub(super) fn check_data_set(
    run: &Run,
    camera: &RunCamera,
    dataset: &Dataset,
    frames: &[PosedFrame],
) -> Result<(), ExportError> {
    let folder = || dataset.folder().to_owned();
    let PinholeCamera { width, height, fx, fy, cx, cy } = dataset.calibration().camera;
    // The run was made with this camera, to the digits that its summary has.
    let values = [
        ("width", width as f64, camera.width as f64),
        ("height", height as f64, camera.height as f64),
        ("fx", fx, camera.fx),
        ("fy", fy, camera.fy),
        ("cx", cx, camera.cx),
        ("cy", cy, camera.cy),
        ("depth_scale", dataset.calibration().depth_scale, camera.depth_scale),
    ];
    let differs = |(_, found, expected): &&(_, f64, f64)| (found - expected).abs() > SAME_CAMERA;
    if let Some(&(field, found, expected)) = values.iter().find(differs) {
        return Err(ExportError::Camera { dataset: folder(), field, found, expected });
    }
    if dataset.len() != run.frames.len() {
        let (found, expected) = (dataset.len(), run.frames.len());
        return Err(ExportError::Frames { dataset: folder(), found, expected });
    }
    // Index and time: the data set may have lost or gained frames in the meantime.
    for frame in frames {
        let (index, expected) = (frame.index, frame.timestamp);
        let found = dataset.timestamp(index);
        if (found - expected).abs() > SAME_TIME {
            return Err(ExportError::Timestamp { dataset: folder(), index, found, expected });
        }
    }
    Ok(())
}
