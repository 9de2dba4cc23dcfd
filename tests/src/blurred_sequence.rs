//! A short blurred sequence of the generator on the disk, runs to start a map from, and maps of it.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use mba_mapper::dataset::{self, Dataset};
use mba_mapper::exposure::{blur_length, motion_of};
use mba_mapper::hindsight::look_back;
use mba_mapper::map::StoredMap;
use mba_mapper::mapping::{MapSettings, map_dataset};
use mba_mapper::output::{OutputFolder, Permission};
use mba_mapper::run::{FrameRecord, FrameStatus, Merit, Run, RunSettings, RunWriter, Summary, TrackRecord};
use mba_mapper::slam::{SlamSettings, run_slam};
use mba_mapper::synth::{SynthConfig, SynthSequence, write_dataset};
use mba_mapper::tracking::{TrackingOptions, track_and_keep, track_dataset};
use mba_mapper::trajectory_file::TimedExposure;
use tempfile::TempDir;

/// Distance at which blur is measured, metres: about where the generator's room is.
const DEPTH: f64 = 2.5;

/// A data set in `data` of a temporary folder, which holds the runs too.
#[derive(Debug)]
pub struct BlurredSequence {
    folder: TempDir,
    /// The data set.
    pub dataset: Dataset,
}

/// How well the frames of a sequence were found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Absolute trajectory error over all frames, root mean square, metres.
    pub ate_m: f64,
    /// Frames that are lost.
    pub lost: usize,
}

impl BlurredSequence {
    /// Renders a sequence.
    ///
    /// # Panics
    /// When that fails.
    #[must_use]
    pub fn new(config: SynthConfig) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let data = folder.path().join("data");
        let sequence = SynthSequence::new(config).expect("settings in range");
        write_dataset(&sequence, &data, |_, _| ()).expect("a written sequence");
        let dataset = dataset::open(&data).expect("a data set");
        Self { folder, dataset }
    }

    /// Six small frames: big enough to map, too small to track.
    ///
    /// # Panics
    /// When they cannot be rendered or written.
    #[must_use]
    pub fn tiny() -> Self {
        let (frames, width, height) = (6, 64, 48);
        Self::new(SynthConfig { frames, width, height, mean_blur_px: 3.0, ..SynthConfig::default() })
    }

    /// Where something lies in the temporary folder.
    #[must_use]
    pub fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join(relative)
    }

    /// The true exposures, one per frame.
    #[must_use]
    pub fn truth(&self) -> &[TimedExposure] {
        self.dataset.ground_truth_exposures()
    }

    /// A run in the folder `name` that found `exposures`, all of them well.
    ///
    /// # Panics
    /// When it cannot be written.
    #[must_use]
    pub fn run_of(&self, name: &str, exposures: &[TimedExposure]) -> Run {
        let folder = self.path(name);
        let mut writer = RunWriter::create_in(&folder, self.describe()).expect("a run");
        for exposure in exposures {
            writer.push(*exposure, self.record(exposure)).expect("a frame");
        }
        writer.finish(|_| ()).expect("a finished run");
        Run::open(&folder).expect("a run")
    }

    /// The tracker's run in the folder `name`.
    ///
    /// # Panics
    /// When tracking fails.
    #[must_use]
    pub fn track(&self, name: &str) -> Run {
        let folder = self.path(name);
        let mut writer = RunWriter::create_in(&folder, self.describe()).expect("a run");
        track_dataset(&self.dataset, &TrackingOptions::default(), &mut writer, |_| ControlFlow::Continue(()))
            .expect("tracked");
        writer.finish(|_| ()).expect("a finished run");
        Run::open(&folder).expect("a run")
    }

    /// Tracks the sequence into the folder `name`, then looks back; returns how well it was found before and after.
    ///
    /// # Panics
    /// When that fails.
    #[must_use]
    pub fn track_both_ways(&self, name: &str) -> [Found; 2] {
        let mut writer = RunWriter::create_in(&self.path(name), self.describe()).expect("a run");
        let options = TrackingOptions::default();
        let go_on = || ControlFlow::Continue(());
        let tracked =
            track_and_keep(&self.dataset, &options, &mut writer, None, |_| go_on()).expect("tracked");
        let found = |track: &TrackRecord| {
            let trajectory = Merit::of(track.exposures(), &self.dataset).trajectory;
            let lost = track.frames().iter().filter(|frame| frame.status == FrameStatus::Lost).count();
            Found { ate_m: trajectory.expect("a true trajectory").ate_m.rmse, lost }
        };
        let before = found(writer.record());
        look_back(&self.dataset, &options, writer.record_mut(), &tracked.measured, go_on)
            .expect("looked back");
        [before, found(writer.record())]
    }

    /// Maps the sequence from `run` into the folder `name`.
    ///
    /// # Panics
    /// When mapping fails.
    pub fn map(&self, run: &Run, name: &str, settings: &MapSettings) -> Summary {
        let (out, go_on) = (self.output(name), |_| ControlFlow::Continue(()));
        map_dataset(&self.dataset, run, settings, out, false, self.describe(), go_on).expect("a map")
    }

    /// Tracks and maps the sequence into the folder `name`.
    ///
    /// # Panics
    /// When that fails.
    pub fn slam(&self, name: &str, settings: &SlamSettings) -> Summary {
        self.slam_of(&self.dataset, name, settings)
    }

    /// Tracks and maps a data set made from this one into the folder `name`.
    ///
    /// # Panics
    /// When that fails.
    pub fn slam_of(&self, dataset: &Dataset, name: &str, settings: &SlamSettings) -> Summary {
        let (out, go_on) = (self.output(name), |_| ControlFlow::Continue(()));
        run_slam(dataset, settings, out, false, self.describe(), go_on).expect("a finished run")
    }

    /// The folder `name` for a run.
    /// The folder of a run of that name beside the data set.
    #[must_use]
    pub fn output(&self, name: &str) -> OutputFolder {
        OutputFolder::for_run(&self.path(name), &Permission::default()).expect("a folder for a run")
    }

    /// What a run of the sequence says about itself.
    #[must_use]
    pub fn describe(&self) -> RunSettings {
        RunSettings::new("test", &self.dataset)
    }

    fn record(&self, exposure: &TimedExposure) -> FrameRecord {
        let blur_px = blur_length(&motion_of(exposure), &self.dataset.calibration().camera, DEPTH);
        let record = FrameRecord::without_figures(exposure.timestamp, FrameStatus::Ok);
        FrameRecord { blur_px, inliers: 1.0, gain: 1.0, ..record }
    }
}

/// Content of a file.
///
/// # Panics
/// When it cannot be read.
#[must_use]
pub fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Names of the files in a folder, sorted.
///
/// # Panics
/// When it cannot be read.
#[must_use]
pub fn names(folder: &Path) -> Vec<String> {
    let files = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let name = |file: std::io::Result<std::fs::DirEntry>| {
        file.expect("an entry").file_name().to_string_lossy().into_owned()
    };
    let mut names: Vec<String> = files.map(name).collect();
    names.sort();
    names
}

/// Asserts that two maps have the same files, bit for bit, in all that does not tell how long it took.
///
/// # Panics
/// When they differ.
pub fn assert_same_map(one: &Path, two: &Path) {
    let map = StoredMap::path(one).expect("a map");
    let map = map.file_name().expect("the name of a file");
    let mut files: Vec<PathBuf> =
        [map, "exposures.txt".as_ref(), "trajectory.txt".as_ref()].map(PathBuf::from).into();
    for images in ["deblurred", "depth"] {
        assert_eq!(names(&one.join(images)), names(&two.join(images)));
        files.extend(names(&one.join(images)).iter().map(|name| Path::new(images).join(name)));
    }
    for file in files {
        assert!(bytes(&one.join(&file)) == bytes(&two.join(&file)), "{} differs", file.display());
    }
}

/// Asserts that two finished runs of the tracker are alike in every byte but those that tell how long it took.
///
/// # Panics
/// When they differ.
pub fn assert_same_track(one: &Path, two: &Path) {
    for file in ["exposures.txt", "trajectory.txt"] {
        assert!(bytes(&one.join(file)) == bytes(&two.join(file)), "{file} differs");
    }
    let images = names(&one.join("deblurred"));
    assert_eq!(images, names(&two.join("deblurred")));
    for image in images.iter().map(|name| Path::new("deblurred").join(name)) {
        assert!(bytes(&one.join(&image)) == bytes(&two.join(&image)), "{} differs", image.display());
    }
    let [one, two] = [one, two].map(|folder| Run::open(folder).expect("a run"));
    let untimed = |run: &Run| -> Vec<String> {
        run.frames.iter().map(|frame| format!("{:?}", FrameRecord { ms: 0.0, ..*frame })).collect()
    };
    assert_eq!(untimed(&one), untimed(&two));
    let untimed = |run: &Run| Summary { milliseconds: None, ..run.summary.clone() };
    assert_eq!(untimed(&one), untimed(&two));
}
