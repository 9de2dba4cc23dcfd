//! The data set that is being written.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use mba_io::FileError;
use mba_io::dataset::{self, write_calibration};
use mba_io::output::{OutputError, OutputFolder};
use mba_io::whole_file::write_together;
use mba_tracker::geometry::RigidTransform;

use crate::ImportError;
use crate::facts::Facts;
use crate::lists::{self, Timed, in_order};
use crate::picture::{Picture, colour_png};
use crate::time::Time;

const COLOUR: &str = "rgb";
const DEPTH: &str = "depth";
const CONFIDENCE: &str = "confidence";
const MASK: &str = "mask";
const SHARP: &str = "sharp";
const CALIBRATION: &str = "calibration.toml";

/// Folders of images, and the texts beside them.
const FOLDERS: [&str; 5] = [COLOUR, DEPTH, CONFIDENCE, MASK, SHARP];
const TEXTS: [&str; 8] = [
    "rgb.txt",
    "depth.txt",
    "exposures.csv",
    "groundtruth.txt",
    "imu.csv",
    "gyro.csv",
    CALIBRATION,
    "calibration_response.csv",
];

/// What was brought in.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Imported {
    /// Number of colour images.
    pub colour_images: usize,
    /// Number of depth images.
    pub depth_images: usize,
    /// Number of frames with an exposure time of their own.
    pub exposures: usize,
    /// Number of recorded poses.
    pub poses: usize,
    /// Number of samples of gyroscope and accelerometer.
    pub inertial_samples: [usize; 2],
    /// What the user should know of how the source was understood.
    pub notes: Vec<String>,
}

/// A data set that is being written; what was written goes again unless [`Self::finish`] succeeds.
#[derive(Debug)]
pub(crate) struct Destination {
    /// Locked until this is dropped.
    _claimed: OutputFolder,
    folder: PathBuf,
    is_finished: bool,
    colour_size: Option<(usize, usize)>,
    depth_size: Option<(usize, usize)>,
    colour: Vec<Timed<String>>,
    depth: Vec<Timed<String>>,
    pub(crate) exposures: Vec<Timed<f64>>,
    pub(crate) poses: Vec<Timed<RigidTransform>>,
    pub(crate) rates: Vec<Timed<[f64; 3]>>,
    pub(crate) forces: Vec<Timed<[f64; 3]>>,
    notes: Vec<String>,
}

impl Destination {
    /// Claims `folder`, which is new or empty and not in `source`.
    ///
    /// # Errors
    /// [`ImportError::Output`] when it may not be written.
    pub(crate) fn claim(folder: &Path, source: &Path) -> Result<Self, ImportError> {
        let is_in_source = source.canonicalize().is_ok_and(|source| {
            let existing = folder.ancestors().find_map(|part| match part.as_os_str().is_empty() {
                true => Path::new(".").canonicalize().ok(),
                false => part.canonicalize().ok(),
            });
            existing.is_some_and(|folder| folder.starts_with(source))
        });
        if is_in_source {
            return Err(OutputError::Input { path: folder.to_owned() }.into());
        }
        let claimed = OutputFolder::for_data_set(folder)?;
        // What a process that was killed left.
        clear(folder);
        Ok(Self {
            _claimed: claimed,
            folder: folder.to_owned(),
            is_finished: false,
            colour_size: None,
            depth_size: None,
            colour: Vec::new(),
            depth: Vec::new(),
            exposures: Vec::new(),
            poses: Vec::new(),
            rates: Vec::new(),
            forces: Vec::new(),
            notes: Vec::new(),
        })
    }

    /// Adds a colour image; `origin` is the file that it comes from. Returns its name without ending.
    ///
    /// # Errors
    /// [`ImportError`] when it is no image, has another size than those before, or cannot be written.
    pub(crate) fn add_colour(
        &mut self,
        time: Time,
        picture: &Picture,
        origin: &Path,
    ) -> Result<String, ImportError> {
        let header = picture.header(origin)?;
        check_size(&mut self.colour_size, header.size, origin)?;
        let stem = format!("{:06}", self.colour.len());
        let name = format!("{COLOUR}/{stem}.{}", header.ending);
        picture.write(&self.place(&name)?)?;
        self.colour.push((time, name));
        Ok(stem)
    }

    /// Adds a depth image; as [`Self::add_colour`].
    pub(crate) fn add_depth(
        &mut self,
        time: Time,
        picture: &Picture,
        origin: &Path,
    ) -> Result<String, ImportError> {
        let header = picture.header(origin)?;
        check_size(&mut self.depth_size, header.size, origin)?;
        let stem = format!("{:06}", self.depth.len());
        let name = format!("{DEPTH}/{stem}.{}", header.ending);
        picture.write(&self.place(&name)?)?;
        self.depth.push((time, name));
        Ok(stem)
    }

    /// Adds the map of confidence of the depth image of that name; `origin` is the file that it comes from.
    ///
    /// # Errors
    /// As [`Self::add_colour`].
    pub(crate) fn add_confidence(
        &mut self,
        stem: &str,
        picture: &Picture,
        origin: &Path,
    ) -> Result<(), ImportError> {
        check_size(&mut self.depth_size, picture.header(origin)?.size, origin)?;
        picture.write(&self.place(&format!("{CONFIDENCE}/{stem}.png"))?)
    }

    /// Adds the mask of the colour image of that name; as [`Self::add_confidence`].
    pub(crate) fn add_mask(
        &mut self,
        stem: &str,
        picture: &Picture,
        origin: &Path,
    ) -> Result<(), ImportError> {
        check_size(&mut self.colour_size, picture.header(origin)?.size, origin)?;
        picture.write(&self.place(&format!("{MASK}/{stem}.png"))?)
    }

    /// Adds the image without blur, of a file, of the colour image of that name; as [`Self::add_confidence`]. Results are
    /// compared with PNG files.
    pub(crate) fn add_sharp(&mut self, stem: &str, origin: &Path) -> Result<(), ImportError> {
        let size = Picture::File(origin.to_owned()).header(origin)?.size;
        check_size(&mut self.colour_size, size, origin)?;
        let image = dataset::read_image(origin)
            .map_err(|error| ImportError::damaged(origin, error.to_string()))?
            .into_rgb8();
        let png =
            colour_png(size, &image).map_err(|error| ImportError::damaged(origin, error.to_string()))?;
        Picture::Encoded(png).write(&self.place(&format!("{SHARP}/{stem}.png"))?)
    }

    /// Adds what the user should know, once.
    pub(crate) fn note(&mut self, note: impl Into<String>) {
        let note = note.into();
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Columns and rows of the colour images, once there is one.
    pub(crate) fn colour_size(&self) -> Option<(usize, usize)> {
        self.colour_size
    }

    /// Columns and rows of the depth images, once there is one.
    pub(crate) fn depth_size(&self) -> Option<(usize, usize)> {
        self.depth_size
    }

    /// Writes lists and calibration, and opens the data set to see whether it is one.
    ///
    /// # Errors
    /// [`ImportError`] when there are no frames, or something cannot be written or used.
    pub(crate) fn finish(mut self, facts: &Facts, source: &Path) -> Result<Imported, ImportError> {
        for (kind, images) in [("colour", &self.colour), ("depth", &self.depth)] {
            if images.is_empty() {
                let hint = "mba needs images of both kinds";
                return Err(ImportError::unusable(source, format!("it has no {kind} images"), hint));
            }
        }
        self.order()?;
        let times: Vec<f64> = self.colour.iter().map(|(time, _)| time.seconds()).collect();
        let calibration = facts.calibration(frame_rate(&times));
        write_calibration(&self.folder.join(CALIBRATION), &calibration)?;
        write_together(&self.texts())?;
        let opened = dataset::open(&self.folder)
            .map_err(|error| ImportError::Unfit { source_path: source.to_owned(), error })?;
        // Whatever every frame has in common shows in the first.
        opened.frame(0).map_err(|error| ImportError::damaged(source, error.to_string()))?;
        self.is_finished = true;
        Ok(Imported {
            colour_images: self.colour.len(),
            depth_images: self.depth.len(),
            exposures: self.exposures.len(),
            poses: self.poses.len(),
            inertial_samples: [self.rates.len(), self.forces.len()],
            notes: std::mem::take(&mut self.notes),
        })
    }

    /// Puts everything in the order of time; nothing occurs twice.
    fn order(&mut self) -> Result<(), ImportError> {
        let mut doubled = in_order(&mut self.colour);
        doubled.extend(in_order(&mut self.depth));
        for name in &doubled {
            let path = self.folder.join(name);
            fs::remove_file(&path).map_err(|reason| unwritable(&path, reason))?;
        }
        if !doubled.is_empty() {
            let count = doubled.len();
            self.note(format!("{count} images that have the time of another one are left out"));
        }
        in_order(&mut self.exposures);
        in_order(&mut self.poses);
        in_order(&mut self.rates);
        in_order(&mut self.forces);
        Ok(())
    }

    /// Paths and contents of the texts.
    fn texts(&self) -> Vec<(PathBuf, String)> {
        let mut texts = lists::inertia(&self.rates, &self.forces);
        if !self.exposures.is_empty() {
            texts.push(("exposures.csv", lists::exposures(&self.exposures)));
        }
        if !self.poses.is_empty() {
            texts.push(("groundtruth.txt", lists::poses(&self.poses)));
        }
        // A folder with both lists is a data set: they come last.
        texts.push(("depth.txt", lists::images(&self.depth)));
        texts.push(("rgb.txt", lists::images(&self.colour)));
        texts.into_iter().map(|(name, text)| (self.folder.join(name), text)).collect()
    }

    /// Where a file belongs, in a folder that is there.
    fn place(&self, name: &str) -> Result<PathBuf, ImportError> {
        let path = self.folder.join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|reason| unwritable(folder, reason))?;
        }
        Ok(path)
    }
}

impl Drop for Destination {
    fn drop(&mut self) {
        if !self.is_finished {
            clear(&self.folder);
        }
    }
}

fn unwritable(path: &Path, reason: io::Error) -> ImportError {
    FileError::Unwritable { path: path.to_owned(), reason }.into()
}

/// Images of one kind have one size.
fn check_size(
    known: &mut Option<(usize, usize)>,
    found: (usize, usize),
    origin: &Path,
) -> Result<(), ImportError> {
    let (width, height) = *known.get_or_insert(found);
    if found == (width, height) {
        return Ok(());
    }
    let reason =
        format!("an image has {} x {} pixels, those before have {width} x {height}", found.0, found.1);
    Err(ImportError::unusable(origin, reason, "split the recording where the size changes"))
}

/// One over the median time between frames, per second; that of most cameras for a single frame.
fn frame_rate(times: &[f64]) -> f64 {
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_by(f64::total_cmp);
    intervals.get(intervals.len() / 2).map_or(30.0, |interval| 1.0 / interval)
}

/// Removes the files of a data set that is not complete, and nothing else.
fn clear(folder: &Path) {
    let remove = |path: PathBuf| {
        let _ = fs::remove_file(path.with_added_extension("partial"));
        let _ = fs::remove_file(path);
    };
    for images in FOLDERS.map(|name| folder.join(name)) {
        for file in fs::read_dir(&images).into_iter().flatten().flatten() {
            if file.file_name().to_str().is_some_and(is_own_image) {
                remove(file.path());
            }
        }
        let _ = fs::remove_dir(images);
    }
    TEXTS.iter().for_each(|name| remove(folder.join(name)));
}

/// Whether a file is named like an image of a data set.
fn is_own_image(name: &str) -> bool {
    let stem = name.strip_suffix(".png").or_else(|| name.strip_suffix(".jpg"));
    stem.is_some_and(|stem| stem.len() >= 6 && stem.bytes().all(|byte| byte.is_ascii_digit()))
}
