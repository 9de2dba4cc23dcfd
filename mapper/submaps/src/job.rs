//! The folder of a job.

use std::path::{Path, PathBuf};

use mba_io::checkpoint::Fingerprint;
use mba_io::dataset::Dataset;
use mba_io::run_layout::SUBMAPS_FILE;
use mba_io::whole_file::{read_text, write_text};
use mba_slam::run::{Run, path_of};

use crate::{Plan, SubmapError};

/// A run that was split.
#[derive(Clone, Debug)]
pub struct Job {
    /// Where it lies.
    pub folder: PathBuf,
    /// Which group has what.
    pub plan: Plan,
    /// Fingerprint of the file with the plan.
    digest: String,
}

impl Job {
    /// Reads the plan of a job.
    ///
    /// # Errors
    /// [`SubmapError::NotAJob`] for a folder without a plan, else what is wrong with it.
    pub fn open(folder: &Path) -> Result<Self, SubmapError> {
        let path = folder.join(SUBMAPS_FILE);
        if !path.is_file() {
            return Err(SubmapError::NotAJob { folder: folder.to_owned() });
        }
        let text = read_text(&path)?;
        let malformed = |message| SubmapError::Malformed { path: path.clone(), message };
        let plan: Plan = serde_json::from_str(&text).map_err(|error| malformed(error.to_string()))?;
        plan.check().map_err(malformed)?;
        Ok(Self { folder: folder.to_owned(), plan, digest: digest(&text) })
    }

    /// Writes the plan of a new job.
    pub(crate) fn write(folder: &Path, plan: Plan) -> Result<Self, SubmapError> {
        let path = folder.join(SUBMAPS_FILE);
        let text = serde_json::to_string_pretty(&plan)
            .map_err(|error| SubmapError::Malformed { path: path.clone(), message: error.to_string() })?;
        let text = text + "\n";
        write_text(&path, &text)?;
        Ok(Self { folder: folder.to_owned(), plan, digest: digest(&text) })
    }

    /// Where the data set was when the run was split.
    #[must_use]
    pub fn dataset(&self) -> PathBuf {
        path_of(&self.plan.dataset)
    }

    /// Where the run was when it was split.
    #[must_use]
    pub fn run(&self) -> PathBuf {
        path_of(&self.plan.run)
    }

    /// RUN folder of group `k`.
    #[must_use]
    pub fn group_folder(&self, k: usize) -> PathBuf {
        self.folder.join(format!("{k:03}"))
    }

    /// Fingerprint of the plan, which the map of every group names.
    #[must_use]
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// Checks that data set and run are those that were split.
    ///
    /// # Errors
    /// [`SubmapError::Changed`].
    pub fn check_inputs(&self, dataset: &Dataset, run: &Run) -> Result<(), SubmapError> {
        let changed = |what| SubmapError::Changed { path: self.folder.join(SUBMAPS_FILE), what };
        if Fingerprint::of_dataset(dataset).to_string() != self.plan.dataset_digest {
            return Err(changed("data set"));
        }
        if run.fingerprint().to_string() != self.plan.run_digest || run.exposures.len() != self.plan.frames {
            return Err(changed("run"));
        }
        Ok(())
    }
}

fn digest(text: &str) -> String {
    Fingerprint::of_bytes(text.as_bytes()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::tests::plan;

    #[test]
    fn a_plan_reads_back_and_damage_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let message = Job::open(folder.path()).unwrap_err().to_string();
        assert!(message.ends_with("is not a job: it has no submaps.json"), "{message}");
        let written = Job::write(folder.path(), plan()).unwrap();
        let job = Job::open(folder.path()).unwrap();
        assert_eq!((&job.plan, job.digest()), (&plan(), written.digest()));
        assert!(job.group_folder(7).ends_with("007"));
        let path = folder.path().join(SUBMAPS_FILE);
        let text = std::fs::read_to_string(&path).unwrap().replace("\"end_frame\": 9", "\"end_frame\": 8");
        std::fs::write(&path, text).unwrap();
        let message = Job::open(folder.path()).unwrap_err().to_string();
        assert!(message.contains("submaps.json: group 1 has the frames 9 to 20"), "{message}");
    }
}
