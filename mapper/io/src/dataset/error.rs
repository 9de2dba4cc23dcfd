//! What can be wrong with a data set as a whole, with one frame, and what is merely odd.

use std::io;
use std::path::PathBuf;

use super::InvalidValue;
use crate::FileError;

/// The data set cannot be used.
///
/// Every message is one sentence that names the file, the line where there is one, and the value.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// A list, trajectory or folder is unreadable or malformed.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder holds none of the layouts that have a reader.
    #[error(
        "{folder} holds no known data set; expected associations.txt or rgb.txt and depth.txt (TUM), traj.txt \
         and results/ (Replica), or color/, depth/, pose/ and intrinsic/ (ScanNet)"
    )]
    UnknownLayout {
        /// The folder.
        folder: PathBuf,
    },
    /// There is neither a calibration file nor a known camera.
    #[error(
        "{folder} has no calibration.toml and is no recording of a known camera (freiburg1, freiburg2, freiburg3, \
         recorded in 2011 and 2012); add that file with the camera's width, height, fx, fy, cx, cy and depth_scale"
    )]
    MissingCalibration {
        /// The folder.
        folder: PathBuf,
    },
    /// The calibration file is not valid, lacks a key or has an unknown one.
    #[error("{path}, line {line}: {message}")]
    CalibrationSyntax {
        /// The calibration file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong, with the name of the key.
        message: String,
    },
    /// A calibration value is absurd.
    #[error("{path}, line {line}: {key} = {value}, expected {expected}")]
    CalibrationValue {
        /// The calibration file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Name of the value.
        key: &'static str,
        /// The value.
        value: String,
        /// Its valid range.
        expected: &'static str,
    },
    /// A calibration that did not come from a file has an absurd value.
    #[error("the calibration is not valid: {0}")]
    InvalidCalibration(#[from] InvalidValue),
    /// There are not as many exposure times as frames.
    #[error("{found} exposure times for {frames} frames")]
    ExposureCount {
        /// Number of exposure times.
        found: usize,
        /// Number of frames.
        frames: usize,
    },
    /// A list has no entries.
    #[error("{path} lists no images")]
    EmptyList {
        /// The list, or the folder of images.
        path: PathBuf,
    },
    /// No colour image has a depth image of the same time.
    #[error(
        "no image of {colour_list} ({colour_count} images) is within {tolerance} s of one of {depth_list} \
         ({depth_count} images); the closest are {closest:.6} s apart, do both use the same clock?"
    )]
    NoAssociation {
        /// List of colour images.
        colour_list: PathBuf,
        /// Number of colour images.
        colour_count: usize,
        /// List of depth images.
        depth_list: PathBuf,
        /// Number of depth images.
        depth_count: usize,
        /// Accepted time difference, seconds.
        tolerance: f64,
        /// Smallest time difference found, seconds.
        closest: f64,
    },
    /// Frames are so far apart that their times must be in another unit.
    #[error(
        "{folder}: frames are {interval:.3} s apart, which {frame_rate} frames per second are not; timestamps are in \
         seconds, these look like {unit}"
    )]
    TimestampUnit {
        /// The data set.
        folder: PathBuf,
        /// Median time between frames, seconds as read.
        interval: f64,
        /// Frame rate of the calibration, per second.
        frame_rate: f64,
        /// The unit that would make it a video.
        unit: &'static str,
        /// How many of that unit are a second.
        per_second: u64,
    },
    /// The first depth image does not have the proportions of the colour images, and its camera is not in the calibration.
    #[error(
        "{path} has {} x {} pixels, the colour images {} x {}; depth of other proportions needs its camera as [depth] \
         in calibration.toml",
        .found.0, .found.1, .expected.0, .expected.1
    )]
    DepthSize {
        /// The depth image.
        path: PathBuf,
        /// Its width and height.
        found: (usize, usize),
        /// Width and height of the colour images.
        expected: (usize, usize),
    },
    /// The first image does not have the size of the calibration.
    #[error("{path} has {} x {} pixels, the calibration says {} x {}", .found.0, .found.1, .expected.0, .expected.1)]
    SizeMismatch {
        /// The image.
        path: PathBuf,
        /// Its width and height.
        found: (usize, usize),
        /// Width and height of the calibration.
        expected: (usize, usize),
    },
}

/// One frame cannot be used; others may be fine, so a caller skips it, counts it and goes on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameReadError {
    /// There is no such frame.
    #[error("frame {index} does not exist, the data set has {len}")]
    IndexOutOfRange {
        /// The index asked for.
        index: usize,
        /// Number of frames.
        len: usize,
    },
    /// An image is missing or unreadable.
    #[error("cannot read {path}: {reason}")]
    Unreadable {
        /// The image.
        path: PathBuf,
        /// What the operating system says.
        reason: io::Error,
    },
    /// The path leads to something that is no file, or to a file of absurd size.
    #[error(transparent)]
    File(#[from] FileError),
    /// The image claims more pixels than any has.
    #[error("{path} has {} x {} pixels, more than the {limit} that are read", .found.0, .found.1)]
    TooManyPixels {
        /// The image.
        path: PathBuf,
        /// Width and height in its header.
        found: (usize, usize),
        /// Most pixels.
        limit: usize,
    },
    /// An image is truncated or otherwise damaged.
    #[error("{path} is damaged or cut off: {reason}")]
    Damaged {
        /// The image.
        path: PathBuf,
        /// What the decoder says.
        reason: String,
    },
    /// An image does not have the size of the calibration.
    #[error("{path} has {} x {} pixels, the calibration says {} x {}", .found.0, .found.1, .expected.0, .expected.1)]
    SizeMismatch {
        /// The image.
        path: PathBuf,
        /// Its width and height.
        found: (usize, usize),
        /// Width and height of the calibration.
        expected: (usize, usize),
    },
    /// A depth image is not 16-bit with one channel.
    #[error("{path} has pixels of type {found}, expected 16-bit grey (L16) for depth")]
    DepthFormat {
        /// The image.
        path: PathBuf,
        /// Type of its pixels.
        found: String,
    },
}

/// Something odd that does not prevent the use of the data set.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Warning {
    /// Images without a partner of the same time were left out.
    #[error("{list}: {count} images have no partner within {tolerance} s and are left out, first at {first}")]
    Unmatched {
        /// The list.
        list: PathBuf,
        /// Number of images left out.
        count: usize,
        /// Timestamp of the first, seconds.
        first: f64,
        /// Accepted time difference, seconds.
        tolerance: f64,
    },
    /// Numbered images without a partner of the same number were left out.
    #[error("{folder}: {count} images have no partner of the same number and are left out, first {first}")]
    Unpaired {
        /// Folder of the images.
        folder: PathBuf,
        /// Number of images left out.
        count: usize,
        /// The first of them.
        first: PathBuf,
    },
    /// An association pairs images that are far apart in time.
    #[error("{list}: {count} pairs are more than {tolerance} s apart, up to {largest:.6} s")]
    LoosePairs {
        /// The list of associations.
        list: PathBuf,
        /// Number of such pairs.
        count: usize,
        /// Expected time difference, seconds.
        tolerance: f64,
        /// Largest time difference, seconds.
        largest: f64,
    },
    /// A depth image is used for several colour images.
    #[error("{list}: {count} depth images are used more than once, first at {first}")]
    DepthReused {
        /// The list of associations.
        list: PathBuf,
        /// Number of repeated uses.
        count: usize,
        /// Timestamp of the first, seconds.
        first: f64,
    },
    /// Listed images do not exist.
    #[error("{count} listed images do not exist, first {first}")]
    MissingImages {
        /// Number of missing files.
        count: usize,
        /// The first of them.
        first: PathBuf,
    },
    /// There is no calibration file; the published calibration of a known camera is used.
    #[error("no calibration.toml, using the published calibration of {camera}")]
    KnownCamera {
        /// Name of the camera.
        camera: &'static str,
    },
    /// A value is not given and assumed.
    #[error("{key} is not given, {value} is assumed")]
    Assumed {
        /// Name of the value.
        key: &'static str,
        /// What is assumed and why.
        value: String,
    },
    /// Frames without a row in the list of exposure times.
    #[error("{path} has no exposure time for {count} frames, first at {first}; {fallback:.4} s is used")]
    ExposureMissing {
        /// The list of exposure times.
        path: PathBuf,
        /// Number of frames.
        count: usize,
        /// Timestamp of the first, seconds.
        first: f64,
        /// Exposure time used for them, seconds.
        fallback: f64,
    },
    /// An exposure time is longer than the time between frames.
    #[error("exposure of {exposure} s is longer than the {interval:.6} s between frames")]
    ExposureTooLong {
        /// Longest exposure time, seconds.
        exposure: f64,
        /// Time between frames, seconds.
        interval: f64,
    },
    /// The timestamps do not fit the frame rate of the calibration.
    #[error("the calibration says {frame_rate} frames per second, the timestamps {measured:.2}")]
    FrameRateDiffers {
        /// Frame rate of the calibration, per second.
        frame_rate: f64,
        /// One over the median time between frames, per second.
        measured: f64,
    },
    /// Images are marked to be shown turned or mirrored.
    #[error(
        "{path} is marked to be shown turned or mirrored (EXIF orientation), and is read as it is {}, which the size in \
         the calibration {}",
        if *.as_shown { "shown" } else { "stored" },
        if *.as_shown { "allows" } else { "asks for" }
    )]
    Orientation {
        /// The first image.
        path: PathBuf,
        /// Whether it is read as it is shown; else as it is stored.
        as_shown: bool,
    },
    /// A list is not in the order of time.
    #[error("{list}: {count} lines are earlier than the one before; the list is read in the order of time")]
    Unsorted {
        /// The list.
        list: PathBuf,
        /// Number of such lines.
        count: usize,
    },
    /// Frames are missing in between.
    #[error("{count} gaps between frames, the longest {longest:.3} s after {after}")]
    Gaps {
        /// Number of gaps.
        count: usize,
        /// The longest gap, seconds.
        longest: f64,
        /// Timestamp before the longest gap, seconds.
        after: f64,
    },
    /// Lines of recorded poses that are no poses.
    #[error("{count} lines of recorded poses are left out, the first because {first}")]
    PosesLeftOut {
        /// How many.
        count: usize,
        /// What is wrong with the first, with file and line.
        first: String,
    },
    /// Frames whose recorded pose is marked as unknown.
    #[error("{count} frames have no valid recorded pose, first {first}")]
    PosesMissing {
        /// Number of frames.
        count: usize,
        /// File of the first.
        first: PathBuf,
    },
    /// Ground truth and frames share no time.
    #[error("{path} covers none of the frames' times")]
    GroundTruthElsewhere {
        /// The ground truth.
        path: PathBuf,
    },
    /// The recording of the IMU cannot be read.
    #[error("{problem}; the IMU is left out")]
    ImuUnusable {
        /// What is wrong, with file and line.
        problem: String,
    },
    /// Recording of the IMU and frames share no time.
    #[error(
        "the recording of the IMU covers none of the frames' times and is left out; do both use the same clock?"
    )]
    ImuElsewhere,
}
