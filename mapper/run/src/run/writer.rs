//! Writing a RUN folder while the run goes on.

use std::fs;
use std::io;
use std::path::Path;

use mba_field::triplane::write_field;
use mba_io::output::{OutputFolder, Permission};
use mba_io::trajectory_file::{TimedExposure, TimedPose, format_exposures, format_trajectory};
use mba_io::whole_file::write_together;
use mba_map::map::{FIELD_FILE, MAP_FILE, Scene, StoredMap};
use mba_raster::gaussians::{ForViewers, Gaussians, write_ply, write_ply_for_viewers};

use super::covariances::format_covariances;
use super::earlier_images::remove_keyframe_images;
use super::merit::mid_pose;
use super::{
    CHECKPOINT_FILE, COVARIANCES_FILE, EXPOSURES_FILE, FRAMES_FILE, FrameRecord, RunError, RunSettings,
    SUMMARY_FILE, Summary, TRAJECTORY_FILE, TrackRecord, frame_record,
};

/// After this many new frames the folder is brought up to date, so that a killed run loses at most these.
const FRAMES_PER_FLUSH: usize = 50;

/// Tracked frames after which a run replaces an earlier one in its folder: the first frame of any input is tracked.
const FRAMES_THAT_PROVE: usize = 2;

/// Collects the results of a run and keeps its folder up to date.
///
/// An earlier run in the folder stays until this one has found two frames or is finished. When this is
/// dropped before [`Self::finish`], e.g. because of an error, what was pushed is still written, marked as incomplete.
#[derive(Debug)]
pub struct RunWriter {
    folder: OutputFolder,
    /// Whether the files in the folder are those of this run.
    pub(super) is_started: bool,
    settings: RunSettings,
    pub(super) record: TrackRecord,
    deblurred: usize,
}

impl RunWriter {
    /// Writes the files of a run without frames, unless there is an earlier run.
    ///
    /// # Errors
    /// [`RunError::Unwritable`] or [`RunError::DiskFull`].
    pub fn create(folder: OutputFolder, settings: RunSettings) -> Result<Self, RunError> {
        let has_earlier = folder.has_earlier();
        let mut writer =
            Self { folder, is_started: false, settings, record: TrackRecord::default(), deblurred: 0 };
        // An earlier run stays as it is until this one has proven itself.
        if !has_earlier {
            writer.start()?;
        }
        Ok(writer)
    }

    /// Creates the writer of a run in `folder`, which no command reads.
    ///
    /// # Errors
    /// As [`OutputFolder::for_run`] and [`Self::create`].
    pub fn create_in(folder: &Path, settings: RunSettings) -> Result<Self, RunError> {
        Self::create(OutputFolder::for_run(folder, &Permission::default())?, settings)
    }

    /// Puts the files of this run in the place of an earlier one. They are on the disk before anything is removed.
    fn start(&mut self) -> Result<(), RunError> {
        self.write(&self.summary())?;
        self.is_started = true;
        self.record.unwritten = 0;
        if !self.folder.has_earlier() {
            return Ok(());
        }
        remove_keyframe_images(self.folder())?;
        if self.record.covariances.is_empty() {
            remove(&self.folder().join(COVARIANCES_FILE))?;
        }
        // A map of the earlier run would be taken for one of this run.
        [MAP_FILE, FIELD_FILE].iter().try_for_each(|name| remove(&self.folder().join(name)))
    }

    /// Whether enough frames were found to take the place of an earlier run.
    fn is_proven(&self) -> bool {
        // Two frames: a single one agrees with itself.
        self.record.found(FRAMES_THAT_PROVE) == FRAMES_THAT_PROVE
    }

    /// Adds one tracked frame; frames come in order of time.
    ///
    /// # Errors
    /// As [`Self::create`]; the frame is kept for the next try.
    pub fn push(&mut self, exposure: TimedExposure, record: FrameRecord) -> Result<(), RunError> {
        self.record.push(exposure, record);
        if self.record.unwritten >= FRAMES_PER_FLUSH { self.flush() } else { Ok(()) }
    }

    /// Adds a frame that could not be tried: its pose is held, its status should be lost.
    ///
    /// # Errors
    /// As [`Self::push`].
    pub fn push_skipped(&mut self, exposure: TimedExposure, record: FrameRecord) -> Result<(), RunError> {
        self.record.skipped += 1;
        self.push(exposure, record)
    }

    /// What is known of the frames so far.
    #[must_use]
    pub fn record(&self) -> &TrackRecord {
        &self.record
    }

    /// The same, to change what is known. The folder follows with the next [`Self::push`] or [`Self::flush`].
    pub fn record_mut(&mut self) -> &mut TrackRecord {
        &mut self.record
    }

    /// Writes the map of the run, and removes one of the other kind that an earlier run left.
    ///
    /// # Errors
    /// As [`Self::create`], and for a map of a kind that has no file.
    pub fn write_map<'a>(&self, map: impl Into<Scene<'a>>) -> Result<(), RunError> {
        let other = match map.into() {
            // A folder has a map of one kind only, so that nobody reads the wrong one.
            Scene::Gaussians(map) => {
                write_ply(&self.folder().join(MAP_FILE), map).map_err(RunError::from_write)?;
                FIELD_FILE
            }
            Scene::Field(map) => {
                write_field(&self.folder().join(FIELD_FILE), map).map_err(RunError::from_write)?;
                MAP_FILE
            }
            Scene::Other(_) => {
                let reason = io::Error::new(io::ErrorKind::Unsupported, "this kind of map has no file");
                return Err(RunError::unwritable(self.folder(), reason));
            }
        };
        remove(&self.folder().join(other))
    }

    /// Writes a map of Gaussians that viewers show as it looks, see [`for_viewers`](super::for_viewers).
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn write_map_for_viewers(&self, map: &Gaussians, viewing: &ForViewers) -> Result<(), RunError> {
        write_ply_for_viewers(&self.folder().join(MAP_FILE), map, viewing).map_err(RunError::from_write)?;
        remove(&self.folder().join(FIELD_FILE))
    }

    /// Bytes of the file of the map; 0 without one.
    #[must_use]
    pub fn map_bytes(&self) -> u64 {
        let path = StoredMap::path(self.folder());
        path.and_then(|path| fs::metadata(path).ok()).map_or(0, |file| file.len())
    }

    /// Removes the checkpoint, also one that a kill left half written.
    fn remove_checkpoint(&self) -> Result<(), RunError> {
        let path = self.folder().join(CHECKPOINT_FILE);
        let half_written = path.with_added_extension("partial");
        [path, half_written].iter().try_for_each(|path| remove(path))
    }

    /// Counts a keyframe whose deblurred image was written.
    pub fn count_deblurred(&mut self) {
        self.deblurred += 1;
    }

    /// The folder of the run.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Brings all files up to date, marked as incomplete; those of an earlier run stay until enough frames were found.
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn flush(&mut self) -> Result<(), RunError> {
        if !self.is_started {
            return if self.is_proven() { self.start() } else { Ok(()) };
        }
        // Even after an error the next attempt waits for more frames: a full disk is not filled at every frame.
        self.record.unwritten = 0;
        self.write(&self.summary())
    }

    /// Takes the place of an earlier run if that has not happened yet, so that images and maps can be written.
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn replace_earlier(&mut self) -> Result<(), RunError> {
        if self.is_started { Ok(()) } else { self.start() }
    }

    /// Whether an earlier run still lies in the folder.
    #[must_use]
    pub fn has_earlier(&self) -> bool {
        !self.is_started
    }

    /// Leaves the folder to the earlier run in it.
    pub fn give_up(mut self) {
        self.record.unwritten = 0;
    }

    /// Writes the finished run; `figures` completes the summary with figures of merit. What a stopped run would have
    /// gone on from is removed.
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn finish(mut self, figures: impl FnOnce(&mut Summary)) -> Result<Summary, RunError> {
        self.replace_earlier()?;
        let mut summary = Summary { complete: true, ..self.summary() };
        figures(&mut summary);
        self.record.unwritten = 0;
        self.write(&summary)?;
        self.remove_checkpoint()?;
        Ok(summary)
    }

    fn summary(&self) -> Summary {
        let summary = Summary::of(&self.settings, &self.record.frames, self.record.skipped);
        Summary {
            warnings: self.record.warnings.clone(),
            deblurred_keyframes: self.deblurred,
            upright: self.record.upright,
            ..summary
        }
    }

    fn write(&self, summary: &Summary) -> Result<(), RunError> {
        let poses: Vec<TimedPose> = self.record.exposures.iter().map(mid_pose).collect();
        let json = serde_json::to_string_pretty(summary).map_err(|error| {
            RunError::unwritable(&self.folder().join(SUMMARY_FILE), io::Error::other(error))
        })?;
        let file = |name: &str, text: String| (self.folder().join(name), text);
        let mut files = vec![
            file(TRAJECTORY_FILE, format_trajectory(&poses)),
            file(EXPOSURES_FILE, format_exposures(&self.record.exposures)),
            file(FRAMES_FILE, frame_record::format_frames(&self.record.frames)),
        ];
        if !self.record.covariances.is_empty() {
            files.push(file(
                COVARIANCES_FILE,
                format_covariances(&self.record.exposures, &self.record.covariances),
            ));
        }
        // Last: a folder with a summary is a run.
        files.push(file(SUMMARY_FILE, json + "\n"));
        write_together(&files).map_err(RunError::from_write)
    }
}

/// Removes a file if there is one.
fn remove(path: &Path) -> Result<(), RunError> {
    match fs::remove_file(path) {
        Err(reason) if reason.kind() != io::ErrorKind::NotFound => Err(RunError::unwritable(path, reason)),
        _ => Ok(()),
    }
}

impl Drop for RunWriter {
    fn drop(&mut self) {
        if self.record.unwritten > 0 {
            // There is nobody left to tell; the error that led here is reported by its own path.
            let _ = self.flush();
        }
    }
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use nalgebra::Vector3;

    use super::super::{FrameStatus, Run, RunCamera};
    use super::*;

    fn settings() -> RunSettings {
        let options = serde_json::Map::from_iter([("virtual_views".to_owned(), 8.into())]);
        let camera = Some(RunCamera::simple(640, 480, 1000.0 / 3.0));
        RunSettings { program: "mba test".into(), dataset: "data".into(), frame_rate: 30.0, camera, options }
    }

    fn frame(k: usize, status: FrameStatus) -> (TimedExposure, FrameRecord) {
        let at = |x: f64| RigidTransform { translation: Vector3::new(x, 0.5, -0.25), ..Default::default() };
        let t = k as f64 / 32.0;
        let exposure = TimedExposure { timestamp: t, start: at(t - 0.125), mid: at(t), end: at(t + 0.125) };
        let lost = status == FrameStatus::Lost;
        let record = FrameRecord {
            timestamp: t,
            status,
            keyframe: u8::from(k == 0),
            ms: (k + 1) as f64,
            blur_px: if lost { f64::NAN } else { 2.0 },
            virtual_views: 8,
            iterations: 12,
            residual: if lost { f64::NAN } else { 0.015625 },
            inliers: 0.75,
            gain: 1.0,
            sigma_m: None,
            reason: None,
        };
        (exposure, record)
    }

    fn push(writer: &mut RunWriter, k: usize, status: FrameStatus) {
        let (exposure, record) = frame(k, status);
        writer.push(exposure, record).unwrap();
    }

    #[test]
    fn a_finished_run_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = RunWriter::create_in(folder.path(), settings()).unwrap();
        push(&mut writer, 0, FrameStatus::Ok);
        push(&mut writer, 1, FrameStatus::Weak);
        let (exposure, record) = frame(2, FrameStatus::Lost);
        writer.push_skipped(exposure, record).unwrap();
        writer.record_mut().warn("odd".into());
        let summary = writer.finish(|_| ()).unwrap();
        assert_eq!((summary.frames.total, summary.frames.lost, summary.frames.skipped), (3, 1, 1));
        assert_eq!(summary.frames.tracked_share(), 2.0 / 3.0);
        assert_eq!(summary.milliseconds.unwrap().median, 2.0);
        assert_eq!(summary.blur_px.unwrap().max, 2.0);

        let run = Run::open(folder.path()).unwrap();
        assert_eq!(run.summary, summary);
        assert!(run.summary.complete);
        assert_eq!(run.exposures[1], frame(1, FrameStatus::Weak).0);
        assert_eq!(run.frames[0], frame(0, FrameStatus::Ok).1);
        assert!(run.frames[2].residual.is_nan());
        let header = fs::read_to_string(folder.path().join("frames.csv")).unwrap();
        assert!(header.starts_with(
            "timestamp,status,keyframe,ms,blur_px,virtual_views,iterations,residual,inliers,gain,sigma_m,reason\n"
        ));
    }

    #[test]
    fn a_revised_frame_replaces_the_first_estimate() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = RunWriter::create_in(folder.path(), settings()).unwrap();
        push(&mut writer, 0, FrameStatus::Ok);
        push(&mut writer, 1, FrameStatus::Ok);
        let better = TimedExposure { timestamp: 0.0, ..frame(7, FrameStatus::Ok).0 };
        writer.record_mut().revise(0, better, 6.5);
        writer.finish(|_| ()).unwrap();
        let run = Run::open(folder.path()).unwrap();
        assert_eq!(run.exposures, [better, frame(1, FrameStatus::Ok).0]);
        assert_eq!((run.frames[0].blur_px, run.frames[1].blur_px), (6.5, 2.0));
    }

    #[test]
    #[should_panic(expected = "frame 1 of a run of 1 frames")]
    fn a_frame_that_was_not_pushed_cannot_be_revised() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = RunWriter::create_in(folder.path(), settings()).unwrap();
        push(&mut writer, 0, FrameStatus::Ok);
        writer.record_mut().revise(1, frame(1, FrameStatus::Ok).0, 1.0);
    }

    #[test]
    fn an_abandoned_run_keeps_its_frames() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = RunWriter::create_in(folder.path(), settings()).unwrap();
        for k in 0..FRAMES_PER_FLUSH {
            push(&mut writer, k, FrameStatus::Ok);
        }
        assert_eq!(
            Run::open(folder.path()).unwrap().frames.len(),
            FRAMES_PER_FLUSH,
            "written as the run goes on"
        );
        push(&mut writer, FRAMES_PER_FLUSH, FrameStatus::Ok);
        drop(writer);
        let run = Run::open(folder.path()).unwrap();
        assert_eq!(run.frames.len(), FRAMES_PER_FLUSH + 1);
        assert!(!run.summary.complete);
    }

    #[test]
    fn an_output_below_a_file_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "x").unwrap();
        let error = RunWriter::create_in(&file.join("run"), settings()).unwrap_err();
        assert!(error.to_string().contains("file/run"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_leaves_the_last_good_version() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = RunWriter::create_in(folder.path(), settings()).unwrap();
        push(&mut writer, 0, FrameStatus::Ok);
        writer.flush().unwrap();
        // Everything written to /dev/full fails for lack of space.
        std::os::unix::fs::symlink("/dev/full", folder.path().join("frames.csv.partial")).unwrap();
        push(&mut writer, 1, FrameStatus::Ok);
        let error = writer.flush().unwrap_err();
        assert!(matches!(error, RunError::DiskFull { ref path } if path.ends_with("frames.csv")), "{error}");
        let run = Run::open(folder.path()).unwrap();
        assert_eq!((run.frames.len(), run.exposures.len(), run.summary.frames.total), (1, 1, 1));
    }
}
