//! An opened data set: a list of frames that are decoded on demand.

use std::path::{Path, PathBuf};

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::image::{
    PixelRectangle, SourcePosition, fill_source_map, region_with_source, remap_bilinear, remap_nearest,
};

use super::calibration::ASSUMED_EXPOSURE_SHARE;
use super::frame::{image_size, read_colour, read_depth};
use super::{Calibration, DatasetError, ExposureSource, FrameError, RgbdFrame, Warning};
use crate::trajectory_file::{TimedExposure, TimedPose};

/// An RGB-D sequence with calibration and, where recorded, ground truth. Images stay on disk until asked for.
#[derive(Clone, Debug)]
pub struct Dataset {
    folder: PathBuf,
    name: String,
    calibration: Calibration,
    entries: Vec<FrameEntry>,
    ground_truth: Vec<TimedPose>,
    ground_truth_exposures: Vec<TimedExposure>,
    warnings: Vec<Warning>,
    colour: ImageSource,
    depth: ImageSource,
    region: PixelRectangle,
}

/// Where one frame is stored.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FrameEntry {
    /// Mid exposure, seconds.
    pub(super) timestamp: f64,
    pub(super) colour: PathBuf,
    pub(super) depth: PathBuf,
    /// Exposure time recorded for this very frame, seconds.
    pub(super) exposure_seconds: Option<f64>,
}

/// What a reader finds in a folder.
pub(super) struct Contents {
    pub(super) calibration: Calibration,
    /// Camera of the colour images if it is not the one of the calibration (which the depth images have).
    pub(super) colour_camera: Option<PinholeCamera>,
    pub(super) entries: Vec<FrameEntry>,
    pub(super) ground_truth: Vec<TimedPose>,
    pub(super) ground_truth_exposures: Vec<TimedExposure>,
    pub(super) warnings: Vec<Warning>,
}

/// Size of the stored images and, unless they are used as they are, how to resample them.
#[derive(Clone, Debug)]
struct ImageSource {
    size: (usize, usize),
    map: Option<Vec<SourcePosition>>,
}

impl Dataset {
    /// Prepares undistortion and checks what can be checked without decoding images.
    pub(super) fn new(folder: &Path, contents: Contents) -> Result<Self, DatasetError> {
        let Contents { calibration, colour_camera, entries, ground_truth, ground_truth_exposures, warnings } =
            contents;
        let camera = calibration.camera;
        let colour_camera = colour_camera.unwrap_or(camera);
        // Before the maps: their memory follows from sizes that may be wrong.
        check_first_size(entries.iter().map(|entry| &entry.colour), size(&colour_camera))?;
        check_first_size(entries.iter().map(|entry| &entry.depth), size(&camera))?;
        let colour = ImageSource::new(&calibration, &colour_camera);
        let depth = ImageSource::new(&calibration, &camera);
        let whole = PixelRectangle { left: 0, top: 0, right: camera.width, bottom: camera.height };
        let region = colour.map.as_ref().map_or(whole, |map| region_with_source(map, camera.width));
        let name = folder_name(folder);
        let folder = folder.to_owned();
        let mut dataset = Self {
            folder,
            name,
            calibration,
            entries,
            ground_truth,
            ground_truth_exposures,
            warnings,
            colour,
            depth,
            region,
        };
        dataset.warn_about_timing();
        dataset.warn_about_missing_images();
        Ok(dataset)
    }

    /// Name of the data set: its folder's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Folder of the data set.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Number of frames, at least 1.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there are no frames; never the case for an opened data set.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// What is known about the camera.
    #[must_use]
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The rectangle of each frame in which every pixel stems from the stored image; smaller than the frame only
    /// where undistortion leaves black borders, which must not be taken for edges.
    #[must_use]
    pub fn region_with_source(&self) -> PixelRectangle {
        self.region
    }

    /// Mid exposure of frame `index` in seconds, increasing with the index.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn timestamp(&self, index: usize) -> f64 {
        self.entries[index].timestamp
    }

    /// Time the shutter was open for frame `index`, seconds: recorded for the frame, else for the camera, else
    /// assumed (see [`ExposureSource`]).
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn exposure_seconds(&self, index: usize) -> f64 {
        self.entry_exposure(&self.entries[index])
    }

    /// Reads, decodes and undistorts frame `index`.
    ///
    /// Colour is interpolated bilinearly, depth takes the nearest stored pixel.
    ///
    /// # Errors
    ///
    /// [`FrameError`] if one of the images is missing, damaged or of the wrong size or type, or the index out of
    /// range. Other frames may be fine: skip this one and count it.
    pub fn frame(&self, index: usize) -> Result<RgbdFrame, FrameError> {
        let len = self.entries.len();
        let entry = self.entries.get(index).ok_or(FrameError::IndexOutOfRange { index, len })?;
        let rgb = self.colour.undistort_colour(read_colour(&entry.colour, self.colour.size)?);
        let depth = self.depth.undistort_depth(read_depth(&entry.depth, self.depth.size)?);
        Ok(RgbdFrame {
            index,
            timestamp: entry.timestamp,
            exposure_seconds: self.entry_exposure(entry),
            width: self.calibration.camera.width,
            height: self.calibration.camera.height,
            rgb,
            depth,
        })
    }

    /// Recorded poses at mid exposure, increasing in time; empty if there are none. Their times need not be
    /// those of the frames.
    #[must_use]
    pub fn ground_truth(&self) -> &[TimedPose] {
        &self.ground_truth
    }

    /// Recorded poses at opening, mid exposure and closing; empty if there are none.
    #[must_use]
    pub fn ground_truth_exposures(&self) -> &[TimedExposure] {
        &self.ground_truth_exposures
    }

    /// Whatever is odd about the data set.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    fn entry_exposure(&self, entry: &FrameEntry) -> f64 {
        entry.exposure_seconds.unwrap_or(self.calibration.fallback_exposure_seconds())
    }

    fn warn_about_timing(&mut self) {
        let frame_rate = self.calibration.frame_rate;
        let interval = 1.0 / frame_rate;
        let times: Vec<f64> = self.entries.iter().map(|entry| entry.timestamp).collect();
        if let Some(measured) = frames_per_second(&times)
            && !(0.5..=2.0).contains(&(measured / frame_rate))
        {
            self.warnings.push(Warning::FrameRateDiffers { frame_rate, measured });
        }
        self.warnings.extend(find_gaps(&times));
        if let ExposureSource::Assumed { seconds } = self.calibration.exposure {
            let value = format!("{seconds:.4} s ({ASSUMED_EXPOSURE_SHARE} of the frame interval)");
            self.warnings.push(Warning::Assumed { key: "exposure_seconds", value });
        }
        let exposure = self.entries.iter().map(|entry| self.entry_exposure(entry)).fold(0.0, f64::max);
        if exposure > interval * 1.001 {
            self.warnings.push(Warning::ExposureTooLong { exposure, interval });
        }
    }

    fn warn_about_missing_images(&mut self) {
        let images = self.entries.iter().flat_map(|entry| [&entry.colour, &entry.depth]);
        let mut missing = images.filter(|path| !path.is_file());
        if let Some(first) = missing.next().cloned() {
            self.warnings.push(Warning::MissingImages { count: 1 + missing.count(), first });
        }
    }
}

impl ImageSource {
    fn new(calibration: &Calibration, captured: &PinholeCamera) -> Self {
        let ideal = &calibration.camera;
        let size = size(captured);
        if calibration.distortion.is_none() && captured == ideal {
            return Self { size, map: None };
        }
        let mut map = vec![[0.0; 2]; ideal.width * ideal.height];
        let filled = fill_source_map(ideal, captured, &calibration.distortion, &mut map);
        Self { size, map: filled.ok().map(|()| map) }
    }

    fn undistort_colour(&self, stored: Vec<u8>) -> Vec<u8> {
        let Some(map) = &self.map else { return stored };
        let mut target = vec![[0; 3]; map.len()];
        let (pixels, _) = stored.as_chunks::<3>();
        let mapped = remap_bilinear(pixels, self.size.0, self.size.1, map, &mut target);
        debug_assert_eq!(mapped, Ok(()), "the decoder checked the size");
        target.into_flattened()
    }

    fn undistort_depth(&self, stored: Vec<u16>) -> Vec<u16> {
        let Some(map) = &self.map else { return stored };
        let mut target = vec![0; map.len()];
        let mapped = remap_nearest(&stored, self.size.0, self.size.1, map, &mut target);
        debug_assert_eq!(mapped, Ok(()), "the decoder checked the size");
        target
    }
}

/// One over the median time between frames; none for a single frame.
pub(super) fn frames_per_second(times: &[f64]) -> Option<f64> {
    median_interval(times).map(|interval| 1.0 / interval)
}

fn median_interval(times: &[f64]) -> Option<f64> {
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_by(f64::total_cmp);
    intervals.get(intervals.len() / 2).copied()
}

/// Intervals of more than one and a half times the median.
fn find_gaps(times: &[f64]) -> Option<Warning> {
    let limit = 1.5 * median_interval(times)?;
    let gaps = times.windows(2).map(|pair| (pair[1] - pair[0], pair[0])).filter(|(gap, _)| *gap > limit);
    let (longest, after) = gaps.clone().max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Warning::Gaps { count: gaps.count(), longest, after })
}

fn size(camera: &PinholeCamera) -> (usize, usize) {
    (camera.width, camera.height)
}

/// Compares the first readable image with the calibration, so that a wrong calibration is found before any work.
fn check_first_size<'a>(
    mut paths: impl Iterator<Item = &'a PathBuf>,
    expected: (usize, usize),
) -> Result<(), DatasetError> {
    match paths.find_map(|path| image_size(path).map(|found| (path, found))) {
        Some((path, found)) if found != expected => {
            Err(DatasetError::SizeMismatch { path: path.clone(), found, expected })
        }
        _ => Ok(()),
    }
}

/// The folder's own name, also for paths such as `.` or `a/..`.
fn folder_name(folder: &Path) -> String {
    let absolute = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    absolute.file_name().map_or_else(|| "dataset".into(), |name| name.to_string_lossy().into_owned())
}
