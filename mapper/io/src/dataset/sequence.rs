//! An opened data set: a list of frames that are decoded on demand.

mod oddities;

use std::path::{Path, PathBuf};

use mba_tracker::SimdLevel;
use mba_tracker::geometry::PinholeCamera;
use mba_tracker::image::PixelRectangle;
use mba_tracker::photometric::{Vignetting, radius_squared};

use super::calibration::check_exposure;
use super::frame::{header, read_colour, read_depth};
use super::image_source::{ColourSource, DepthSource, check_is_there, size};
use super::usable_depth::UsableDepth;
use super::vignetting::{falloff_of_frames, falloff_of_pixels};
use super::{
    Calibration, DatasetError, DepthCamera, ExposureSource, FrameReadError, InvalidValue, Knowledge,
    RgbdFrame, Warning,
};
use crate::imu::ImuRecording;
use crate::trajectory_file::{TimedExposure, TimedPose};

/// An RGB-D sequence with calibration and, where recorded, ground truth. Images stay on disk until asked for.
#[derive(Clone, Debug)]
pub struct Dataset {
    folder: PathBuf,
    name: String,
    calibration: Calibration,
    /// As in [`Contents`].
    colour_camera: Option<PinholeCamera>,
    entries: Vec<FrameEntry>,
    ground_truth: Vec<TimedPose>,
    ground_truth_exposures: Vec<TimedExposure>,
    imu: Option<ImuRecording>,
    /// Of the reader; those about times follow from calibration and entries.
    reader_warnings: Vec<Warning>,
    warnings: Vec<Warning>,
    colour: ColourSource,
    depth: DepthSource,
    usable: UsableDepth,
    region: PixelRectangle,
    simd: SimdLevel,
}

/// Where one frame is stored.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FrameEntry {
    /// Mid exposure, seconds.
    pub(super) timestamp: f64,
    /// That of the depth image itself, seconds; that of colour where it has none.
    pub(super) depth_timestamp: f64,
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

impl Dataset {
    /// Prepares undistortion and checks what can be checked without decoding images.
    pub(super) fn new(folder: &Path, contents: Contents, simd: SimdLevel) -> Result<Self, DatasetError> {
        let Contents { calibration, colour_camera, entries, ground_truth, ground_truth_exposures, warnings } =
            contents;
        check_unit(folder, &entries, calibration.frame_rate)?;
        let camera = calibration.camera;
        let captured = colour_camera.unwrap_or(camera);
        // Before the maps: their memory follows from sizes that may be wrong.
        let has_colour = check_first_size(entries.iter().map(|entry| &entry.colour), size(&captured))?;
        let (depth_camera, has_depth) = depth_camera(&entries, &calibration, has_colour)?;
        let colour = ColourSource::new(&calibration, &captured, has_colour);
        let depth = DepthSource::new(&calibration, depth_camera.as_ref(), has_depth);
        let region = colour.region(&camera);
        let mut dataset = Self {
            name: folder_name(folder),
            folder: folder.to_owned(),
            calibration,
            colour_camera,
            entries,
            ground_truth,
            ground_truth_exposures,
            imu: None,
            reader_warnings: warnings,
            warnings: Vec::new(),
            colour,
            depth,
            usable: UsableDepth::of(folder),
            region,
            simd,
        };
        dataset.collect_warnings();
        Ok(dataset)
    }

    /// The same recording as another calibration describes it: undistortion, times and the axes of the IMU follow
    /// from it. Exposure times of single frames are kept if it has them per frame, and dropped otherwise.
    ///
    /// # Errors
    ///
    /// [`DatasetError::InvalidCalibration`] for absurd values and for an exposure per frame where the frames have
    /// none, [`DatasetError::SizeMismatch`] if the images have another size.
    pub fn with_calibration(self, calibration: Calibration) -> Result<Self, DatasetError> {
        calibration.check()?;
        let is_per_frame = calibration.exposure == ExposureSource::PerFrame;
        let mut entries = self.entries;
        if is_per_frame && entries.iter().any(|entry| entry.exposure_seconds.is_none()) {
            return Err(DatasetError::InvalidCalibration(InvalidValue {
                key: "exposure_seconds",
                value: "per frame".to_owned(),
                expected: "one number, as there is none for each frame",
            }));
        }
        // Times of single frames would take precedence over the one that was given.
        if !is_per_frame {
            entries.iter_mut().for_each(|entry| entry.exposure_seconds = None);
        }
        // Everything is looked at again, as when the folder was opened.
        let contents = Contents {
            calibration,
            colour_camera: self.colour_camera,
            entries,
            ground_truth: self.ground_truth,
            ground_truth_exposures: self.ground_truth_exposures,
            warnings: self.reader_warnings,
        };
        Self::new(&self.folder, contents, self.simd)
    }

    /// Replaces the exposure times of all frames by estimates, seconds, one for each frame.
    ///
    /// # Errors
    ///
    /// [`DatasetError::ExposureCount`], [`DatasetError::InvalidCalibration`] for a time that no shutter has; then
    /// nothing changes.
    pub fn set_exposures(&mut self, seconds: Vec<f64>) -> Result<(), DatasetError> {
        let (found, frames) = (seconds.len(), self.entries.len());
        if found != frames {
            return Err(DatasetError::ExposureCount { found, frames });
        }
        seconds.iter().try_for_each(|seconds| check_exposure(*seconds))?;
        for (entry, seconds) in self.entries.iter_mut().zip(seconds) {
            entry.exposure_seconds = Some(seconds);
        }
        self.calibration.exposure = ExposureSource::PerFrame;
        self.calibration.sources.exposure = Knowledge::Estimated;
        self.collect_warnings();
        Ok(())
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

    /// The instructions that the data set was opened for. Its images are resampled with them, and what tracks or maps it takes
    /// them from here: so one run has one level. Levels differ in the last digits of what they compute.
    #[must_use]
    pub fn simd(&self) -> SimdLevel {
        self.simd
    }

    /// The camera of the stored colour images: that of the calibration, unless frames are those of another one.
    #[must_use]
    pub fn stored_colour_camera(&self) -> PinholeCamera {
        self.colour_camera.unwrap_or(self.calibration.camera)
    }

    /// The stored colour and depth image of frame `index`.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn image_paths(&self, index: usize) -> [&Path; 2] {
        let entry = self.entry(index);
        [&entry.colour, &entry.depth]
    }

    /// Whether there was any colour and any depth image when the data set was opened. If not, no frame can be read, and
    /// the size in the calibration is a mere claim.
    #[must_use]
    pub fn has_images(&self) -> bool {
        self.colour.is_there && self.depth.is_there
    }

    /// The rectangle of each frame in which every pixel stems from the stored image; smaller than the frame only
    /// where undistortion leaves black borders, which must not be taken for edges.
    #[must_use]
    pub fn region_with_source(&self) -> PixelRectangle {
        self.region
    }

    /// Mid exposure of the middle of frame `index` in seconds, increasing with the index.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn timestamp(&self, index: usize) -> f64 {
        self.entry(index).timestamp
    }

    /// When the depth of frame `index` was measured, seconds: by the delay of the calibration, else by the depth
    /// image's own timestamp, else that of colour.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn depth_timestamp(&self, index: usize) -> f64 {
        self.entry_depth_timestamp(self.entry(index))
    }

    /// Time the shutter was open for frame `index`, seconds: recorded for the frame, else for the camera, else
    /// assumed (see [`ExposureSource`]).
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn exposure_seconds(&self, index: usize) -> f64 {
        self.entry_exposure(self.entry(index))
    }

    fn entry(&self, index: usize) -> &FrameEntry {
        let frames = self.entries.len();
        self.entries.get(index).unwrap_or_else(|| panic!("frame {index} of a data set of {frames} frames"))
    }

    /// Reads, decodes and undistorts frame `index`.
    ///
    /// Colour is interpolated bilinearly, depth takes the nearest stored pixel.
    ///
    /// # Errors
    ///
    /// [`FrameReadError`] if one of the images is missing, damaged or of the wrong size or type, or the index out of
    /// range. Other frames may be fine: skip this one and count it.
    pub fn frame(&self, index: usize) -> Result<RgbdFrame, FrameReadError> {
        let len = self.entries.len();
        let entry = self.entries.get(index).ok_or(FrameReadError::IndexOutOfRange { index, len })?;
        let rgb = self.colour.undistort(self.simd, read_colour(&entry.colour, self.colour.size)?);
        let depth = self.frame_depth(entry)?;
        check_is_there(self.colour.is_there, &entry.colour)?;
        check_is_there(self.depth.is_there, &entry.depth)?;
        Ok(RgbdFrame {
            index,
            timestamp: entry.timestamp,
            depth_timestamp: self.entry_depth_timestamp(entry),
            exposure_seconds: self.entry_exposure(entry),
            width: self.calibration.camera.width,
            height: self.calibration.camera.height,
            rgb,
            depth,
        })
    }

    /// The depth of a frame's pixels, as far as it can be used.
    fn frame_depth(&self, entry: &FrameEntry) -> Result<Vec<u16>, FrameReadError> {
        let mut stored = read_depth(&entry.depth, self.depth.size)?;
        self.usable.remove_unsure(&mut stored, &entry.depth, self.depth.size)?;
        let mut depth = self.depth.seen(self.simd, stored);
        if let Some(mask) = self.usable.mask(&entry.colour, self.colour.size)? {
            let mask = self.colour.undistort_mask(self.simd, mask);
            depth.iter_mut().zip(mask).for_each(|(depth, is_used)| *depth *= is_used);
        }
        Ok(depth)
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

    /// What the IMU recorded, in the axes of the camera, if there was one and its file is good.
    #[must_use]
    pub fn imu(&self) -> Option<&ImuRecording> {
        self.imu.as_ref()
    }

    /// The data set without its IMU, with a warning that says why.
    #[must_use]
    pub fn without_imu(mut self, problem: String) -> Self {
        self.imu = None;
        self.warnings.push(Warning::ImuUnusable { problem });
        self
    }

    /// The share of light that the lens lets through to each pixel of the frames, row by row, from 0 to about 1;
    /// none for a lens without fall-off. Undistortion is taken into account: the fall-off is that of the stored image.
    #[must_use]
    pub fn light_falloff(&self) -> Option<Vec<f32>> {
        let Calibration { vignetting, camera, .. } = &self.calibration;
        let source = self.colour.map.as_deref();
        (self.colour.is_there && !vignetting.is_none())
            .then(|| falloff_of_pixels(vignetting, camera, self.colour.size, source))
    }

    /// Squared distance of a pixel of the frames from the middle of the stored image, where it is 1 in the corners. A pixel
    /// outside of the frames counts as the nearest inside.
    pub fn stored_radius_squared(&self, u: f64, v: f64) -> f64 {
        let PinholeCamera { width, height, .. } = self.calibration.camera;
        let nearest = |pixel: f64, side: usize| pixel.round().clamp(0.0, side as f64 - 1.0) as usize;
        let place = match self.colour.map.as_deref() {
            Some(map) => map[nearest(v, height) * width + nearest(u, width)].map(f64::from),
            None => [u, v],
        };
        radius_squared(self.colour.size.0, self.colour.size.1, place[0], place[1])
    }

    /// The fall-off of light over the frames as a polynomial of the distance from their middle: that of the calibration, for
    /// frames without the distortion of the stored image the nearest one.
    #[must_use]
    pub fn vignetting(&self) -> Vignetting {
        let Calibration { vignetting, camera, .. } = &self.calibration;
        falloff_of_frames(vignetting, camera, self.colour.size, self.colour.map.as_deref())
    }

    /// Whatever is odd about the data set.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    fn entry_exposure(&self, entry: &FrameEntry) -> f64 {
        entry.exposure_seconds.unwrap_or(self.calibration.fallback_exposure_seconds())
    }

    fn entry_depth_timestamp(&self, entry: &FrameEntry) -> f64 {
        let delayed = |delay| entry.timestamp + delay;
        let by_its_clock = entry.depth_timestamp + self.calibration.depth_clock_seconds;
        self.calibration.depth_delay_seconds.map_or(by_its_clock, delayed)
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

/// Refuses times that are no video's in seconds, but one in another unit.
fn check_unit(folder: &Path, entries: &[FrameEntry], frame_rate: f64) -> Result<(), DatasetError> {
    // Every hundredth frame of a video is still read.
    const MOST_INTERVALS: f64 = 150.0;
    let times: Vec<f64> = entries.iter().map(|entry| entry.timestamp).collect();
    let Some(interval) = median_interval(&times) else { return Ok(()) };
    let (unit, per_second) = match interval * frame_rate {
        ..=MOST_INTERVALS => return Ok(()),
        ..3e4 => ("milliseconds", 1_000),
        ..3e7 => ("microseconds", 1_000_000),
        _ => ("nanoseconds", 1_000_000_000),
    };
    Err(DatasetError::TimestampUnit { folder: folder.to_owned(), interval, frame_rate, unit, per_second })
}

/// Compares the first readable image with the calibration, so that a wrong calibration is found before any work; says
/// whether there is one.
fn check_first_size<'a>(
    mut paths: impl Iterator<Item = &'a PathBuf>,
    expected: (usize, usize),
) -> Result<bool, DatasetError> {
    match paths.find_map(|path| header(path).map(|found| (path, found))) {
        Some((path, found)) if !found.has_size(expected) => {
            Err(DatasetError::SizeMismatch { path: path.clone(), found: found.stored, expected })
        }
        first => Ok(first.is_some()),
    }
}

/// The camera of the depth images where it is not that of the calibration, and whether there is any image. One that is not
/// described is that of colour with pixels of another size, if the images have its proportions.
fn depth_camera(
    entries: &[FrameEntry],
    calibration: &Calibration,
    has_colour: bool,
) -> Result<(Option<DepthCamera>, bool), DatasetError> {
    let depths = || entries.iter().map(|entry| &entry.depth);
    if let Some(own) = calibration.depth_camera {
        return Ok((Some(own), check_first_size(depths(), size(&own.camera))?));
    }
    let camera = &calibration.camera;
    match check_first_size(depths(), size(camera)) {
        Err(DatasetError::SizeMismatch { found, .. })
            if has_colour && found.0 * camera.height == found.1 * camera.width =>
        {
            Ok((Some(DepthCamera::same_view(camera, found)), true))
        }
        Err(DatasetError::SizeMismatch { path, found, expected }) if has_colour => {
            Err(DatasetError::DepthSize { path, found, expected })
        }
        has_depth => Ok((None, has_depth?)),
    }
}

/// The folder's own name, also for paths such as `.` or `a/..`.
fn folder_name(folder: &Path) -> String {
    let absolute = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    absolute.file_name().map_or_else(|| "dataset".into(), |name| name.to_string_lossy().into_owned())
}
