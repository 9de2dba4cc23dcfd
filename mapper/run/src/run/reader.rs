//! Reading a RUN folder.

use std::path::{Path, PathBuf};

use mba_io::checkpoint::Fingerprint;
use mba_io::trajectory_file::{TimedExposure, read_exposures};
use mba_io::whole_file::read_text;

use super::{EXPOSURES_FILE, FRAMES_FILE, SUMMARY_FILE};
use super::{FrameRecord, RunError, Summary, frame_record};

/// A run as its folder tells it.
#[derive(Clone, Debug)]
pub struct Run {
    /// Where it lies.
    pub folder: PathBuf,
    /// Settings, counts and figures.
    pub summary: Summary,
    /// Poses per frame.
    pub exposures: Vec<TimedExposure>,
    /// What else is known per frame.
    pub frames: Vec<FrameRecord>,
}

impl Run {
    /// Reads a finished or interrupted run.
    ///
    /// # Errors
    /// [`RunError::NotARun`] for a folder without a summary, else what is wrong with which file.
    pub fn open(folder: &Path) -> Result<Self, RunError> {
        let path = folder.join(SUMMARY_FILE);
        if !path.is_file() {
            return Err(RunError::NotARun { folder: folder.to_owned(), missing: SUMMARY_FILE });
        }
        // The summary comes first: it says whether the folder is a run at all.
        let json = read_text(&path)?;
        let malformed = |message| RunError::MalformedSummary { path: path.clone(), message };
        let summary: Summary = serde_json::from_str(&json).map_err(|error| malformed(error.to_string()))?;
        // Commands divide by focal lengths and allocate by sizes.
        if let Some(camera) = &summary.settings.camera {
            camera.check().map_err(|error| malformed(format!("camera: {error}")))?;
        }
        Ok(Self {
            folder: folder.to_owned(),
            summary,
            exposures: read_exposures(&folder.join(EXPOSURES_FILE))?,
            frames: frame_record::read_frames(&folder.join(FRAMES_FILE))?,
        })
    }

    /// Of the poses and of what was said of the frames, wherever the run lies.
    #[must_use]
    pub fn fingerprint(&self) -> Fingerprint {
        // As text that tells all numbers apart.
        let exposures: Vec<String> = self.exposures.iter().map(|exposure| format!("{exposure:?}")).collect();
        let records: Vec<String> = self.frames.iter().map(|record| format!("{record:?}")).collect();
        Fingerprint::of(&(exposures, records))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::{RunCamera, RunSettings, RunWriter};
    use super::*;

    #[test]
    fn another_folder_is_not_a_run() {
        let folder = tempfile::tempdir().unwrap();
        let error = Run::open(folder.path()).unwrap_err();
        assert!(error.to_string().ends_with("is not a run folder: it has no summary.json"), "{error}");
    }

    #[test]
    fn a_bad_camera_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let camera = Some(RunCamera { fx: 0.0, ..RunCamera::simple(64, 48, 50.0) });
        let (program, dataset) = (String::new(), String::new());
        let settings =
            RunSettings { program, dataset, frame_rate: 30.0, camera, options: Default::default() };
        RunWriter::create_in(folder.path(), settings).unwrap();
        let message = Run::open(folder.path()).unwrap_err().to_string();
        assert!(message.contains("summary.json: camera: fx is 0, expected a focal length"), "{message}");
    }

    #[test]
    fn a_bad_cell_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FRAMES_FILE);
        let header = "timestamp,status,keyframe,ms,blur_px,virtual_views,iterations,residual,inliers,gain";
        fs::write(&path, format!("{header}\n0.1,ok,1,2,3,8,9,0.1,0.9,1\n0.2,ok,0,fast,3,8,9,0.1,0.9,1\n"))
            .unwrap();
        let message = frame_record::read_frames(&path).unwrap_err().to_string();
        assert!(message.ends_with("frames.csv, line 3: column ms: invalid float literal"), "{message}");
        fs::write(&path, format!("{header}\n0.1,good,1,2,3,8,9,0.1,0.9,1\n")).unwrap();
        let message = frame_record::read_frames(&path).unwrap_err().to_string();
        assert!(message.contains("line 2") && message.contains("good"), "{message}");
    }
}
