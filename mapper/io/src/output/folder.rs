//! A folder that one process may write.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use super::lock::{self, Lock};
use super::place::{Place, resolve};
use super::{OutputError, is_lock};
use crate::file_kind::kind_of;
use crate::run_layout::{DEBLURRED_FOLDER, DEPTH_FOLDER, is_job, is_run};

/// What the user allows, and what the command reads.
#[derive(Clone, Copy, Debug, Default)]
pub struct Permission<'a> {
    /// Write over files and folders of others.
    pub force: bool,
    /// Data sets, runs and files that the command reads, none of which it may write.
    pub inputs: &'a [&'a Path],
}

/// How a kind of folder is recognised.
pub(super) struct Layout {
    /// Whether a folder is one of the kind that was written before.
    pub(super) recognise: fn(&Path) -> bool,
    /// Folders in it.
    pub(super) folders: &'static [&'static str],
}

const DATA_SET: Layout = Layout { recognise: |_| false, folders: &[] };

const RUN: Layout = Layout { recognise: is_run, folders: &[DEBLURRED_FOLDER, DEPTH_FOLDER] };

const JOB: Layout = Layout { recognise: is_job, folders: &[] };

/// A folder that may be written, locked until this is dropped. Nothing in it has been changed.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    has_earlier: bool,
    /// Folders that did not exist, outermost first; those that stay empty go again.
    created: Vec<PathBuf>,
    lock: Option<Lock>,
}

impl OutputFolder {
    /// Claims `path` for a RUN: a new or empty folder, or one with an earlier run.
    ///
    /// # Errors
    /// See [`OutputError`]; nothing has changed then.
    pub fn for_run(path: &Path, permission: &Permission<'_>) -> Result<Self, OutputError> {
        Self::claim(path, permission, &RUN)
    }

    /// Claims `path` for a data set: a new or empty folder, or one in which a process was killed.
    ///
    /// # Errors
    /// See [`OutputError`]; nothing has changed then.
    pub fn for_data_set(path: &Path) -> Result<Self, OutputError> {
        Self::claim(path, &Permission::default(), &DATA_SET)
    }

    /// Claims `path` for a job of submaps: a new or empty folder, or one with an earlier job.
    ///
    /// # Errors
    /// See [`OutputError`]; nothing has changed then.
    pub fn for_job(path: &Path, permission: &Permission<'_>) -> Result<Self, OutputError> {
        Self::claim(path, permission, &JOB)
    }

    /// Whether `path` is a folder with something in it and without a lock.
    #[must_use]
    pub fn is_in_use_by_others(path: &Path) -> bool {
        !lock::has_lock_file(path) && names(path).is_ok_and(|names| !names.is_empty())
    }

    pub(super) fn claim(
        path: &Path,
        permission: &Permission<'_>,
        layout: &Layout,
    ) -> Result<Self, OutputError> {
        if path == Path::new("-") {
            return Err(OutputError::NotAFolder { path: path.to_owned(), kind: "stream" });
        }
        let place = resolve(path)?;
        place.check_recordings(path, permission.inputs)?;
        place.check_inputs(path, permission.inputs)?;
        let has_earlier = examine(&place, path, permission.force, layout)?;
        let created = create(&place.path).map_err(|reason| OutputError::unwritable(path, reason))?;
        let mut folder = Self { path: path.to_owned(), has_earlier, created, lock: None };
        folder.lock = Some(Lock::take(&place.path, path)?);
        Ok(folder)
    }

    /// The folder as it was named.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it holds what was written before.
    #[must_use]
    pub fn has_earlier(&self) -> bool {
        self.has_earlier
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        self.lock = None;
        // Only empty folders can be removed this way.
        while let Some(folder) = self.created.pop() {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Refuses what is not to be written over; returns whether there is an earlier output of the same kind.
fn examine(place: &Place, path: &Path, force: bool, layout: &Layout) -> Result<bool, OutputError> {
    match place.found {
        None => return Ok(false),
        Some(found) if found.is_dir() => {}
        Some(found) => return Err(OutputError::NotAFolder { path: path.to_owned(), kind: kind_of(found) }),
    }
    let foreign = |found: String| OutputError::Foreign { path: path.to_owned(), found };
    let has_earlier = (layout.recognise)(&place.path);
    let is_own = has_earlier || lock::has_lock_file(&place.path);
    let first = names(&place.path).map_err(|reason| OutputError::unwritable(path, reason))?;
    if let (false, false, Some(first)) = (is_own, force, first.first()) {
        return Err(foreign(first.to_string_lossy().into_owned()));
    }
    for name in layout.folders {
        let (inner, shown) = (place.path.join(name), path.join(name));
        match fs::symlink_metadata(&inner) {
            Err(_) => {}
            Ok(found) if found.is_dir() => {
                // Images of others would be mixed with those that come: not even by force.
                let is_empty =
                    names(&inner).map_err(|reason| OutputError::unwritable(&shown, reason))?.is_empty();
                if !is_own && !is_empty {
                    return Err(foreign(format!("{name}/ with files")));
                }
            }
            // A link may lead into a recording.
            Ok(found) => {
                return Err(OutputError::NotAFolder { path: shown, kind: kind_of(found.file_type()) });
            }
        }
    }
    Ok(has_earlier)
}

/// Names of what a folder holds besides a lock, sorted.
fn names(folder: &Path) -> std::io::Result<Vec<OsString>> {
    let entries = fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.file_name()));
    let mut names = entries.collect::<Result<Vec<_>, _>>()?;
    names.retain(|name| !is_lock(name));
    names.sort();
    Ok(names)
}

/// Makes a folder and those above it; returns those that did not exist, outermost first.
fn create(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut missing: Vec<PathBuf> =
        folder.ancestors().take_while(|folder| !folder.exists()).map(Path::to_owned).collect();
    fs::create_dir_all(folder)?;
    missing.reverse();
    Ok(missing)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(path: &Path, force: bool) -> Result<OutputFolder, OutputError> {
        OutputFolder::for_run(path, &Permission { force, inputs: &[] })
    }

    #[test]
    fn folders_that_stay_empty_go_again() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("new/run");
        drop(claim(&run, false).unwrap());
        assert!(!folder.path().join("new").exists());
        let claimed = claim(&run, false).unwrap();
        assert!(!claimed.has_earlier());
        fs::write(run.join("summary.json"), "{}").unwrap();
        drop(claimed);
        assert_eq!(names(&run).unwrap(), ["summary.json"]);
    }

    #[test]
    fn a_folder_of_others_is_refused_unless_forced() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("thesis.tex"), "x").unwrap();
        let message = claim(folder.path(), false).unwrap_err().to_string();
        assert!(message.ends_with("it holds thesis.tex, which this program did not write"), "{message}");
        assert!(claim(folder.path(), true).is_ok());
        // Images in a folder that a run would fill are in danger even then.
        fs::create_dir(folder.path().join("depth")).unwrap();
        assert!(claim(folder.path(), true).is_ok());
        fs::write(folder.path().join("depth/000000.png"), "x").unwrap();
        let message = claim(folder.path(), true).unwrap_err().to_string();
        assert!(message.contains("it holds depth/ with files"), "{message}");
    }

    #[cfg(unix)]
    #[test]
    fn a_data_set_is_never_written_through_links_neither() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("data/depth")).unwrap();
        fs::write(at("data/associations.txt"), "").unwrap();
        symlink("data", at("link")).unwrap();
        for place in ["data", "data/run", "link", "link/depth", "data/depth/../new"] {
            let error = claim(&at(place), true).unwrap_err();
            assert!(matches!(error, OutputError::DataSet { .. }), "{place}: {error}");
        }
        // A run whose folder of depth maps is a link into the data set.
        fs::create_dir(at("run")).unwrap();
        symlink("../data/depth", at("run/depth")).unwrap();
        let error = claim(&at("run"), true).unwrap_err();
        assert!(matches!(error, OutputError::NotAFolder { kind: "link", .. }), "{error}");
        let error = claim(Path::new("/dev/null"), true).unwrap_err();
        assert!(matches!(error, OutputError::NotAFolder { kind: "device", .. }), "{error}");
    }
}
