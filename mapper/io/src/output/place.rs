//! Where a path leads to, and whether that is part of a recording.

use std::ffi::OsString;
use std::fs::{self, FileType};
use std::io;
use std::path::{Component, Path, PathBuf};

use super::OutputError;
use crate::dataset::is_data_set;

/// What a path leads to, all links followed.
#[derive(Debug)]
pub(super) struct Place {
    /// The path from the root, without links and `..`.
    pub(super) path: PathBuf,
    /// What is there; `None` for nothing.
    pub(super) found: Option<FileType>,
}

/// Follows `path` to its end, of which the last parts need not exist.
pub(super) fn resolve(path: &Path) -> Result<Place, OutputError> {
    let unwritable = |reason| OutputError::unwritable(path, reason);
    let mut place = PathBuf::from(".").canonicalize().map_err(unwritable)?;
    let mut missing: Vec<OsString> = Vec::new();
    for component in path.components() {
        match component {
            Component::Prefix(_) | Component::RootDir => place.push(component),
            Component::CurDir => {}
            // What comes before a step up has to be there, or the step leads somewhere else once it is made.
            Component::ParentDir if !missing.is_empty() => {
                return Err(unwritable(io::ErrorKind::NotFound.into()));
            }
            Component::ParentDir => {
                place.pop();
            }
            Component::Normal(name) if !missing.is_empty() => missing.push(name.to_owned()),
            Component::Normal(name) => match step(&place.join(name), path)? {
                Some(next) => place = next,
                None => missing.push(name.to_owned()),
            },
        }
    }
    if missing.is_empty() {
        let found = Some(fs::metadata(&place).map_err(unwritable)?.file_type());
        return Ok(Place { path: place, found });
    }
    place.extend(missing);
    Ok(Place { path: place, found: None })
}

/// Where one more part of `path` leads; `None` if it does not exist.
fn step(next: &Path, path: &Path) -> Result<Option<PathBuf>, OutputError> {
    match fs::symlink_metadata(next) {
        Err(reason) if reason.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(reason) => Err(OutputError::unwritable(path, reason)),
        Ok(found) if found.is_symlink() => {
            let dead = |_| OutputError::DeadLink { path: path.to_owned(), link: next.to_owned() };
            next.canonicalize().map(Some).map_err(dead)
        }
        Ok(_) => Ok(Some(next.to_owned())),
    }
}

impl Place {
    /// Refuses a place in a recording: in one of `inputs`, or in any folder that looks like a data set.
    pub(super) fn check_recordings(&self, path: &Path, inputs: &[&Path]) -> Result<(), OutputError> {
        let inputs = inputs.iter().filter_map(|input| input.canonicalize().ok());
        let known = inputs.filter(|input| is_data_set(input)).find(|input| self.path.starts_with(input));
        let recognised = || self.path.ancestors().find(|folder| is_data_set(folder)).map(Path::to_owned);
        match known.or_else(recognised) {
            Some(dataset) => Err(OutputError::DataSet { path: path.to_owned(), dataset }),
            None => Ok(()),
        }
    }

    /// Refuses a place that the command reads.
    pub(super) fn check_inputs(&self, path: &Path, inputs: &[&Path]) -> Result<(), OutputError> {
        let is_read =
            inputs.iter().filter_map(|input| input.canonicalize().ok()).any(|input| input == self.path);
        if is_read { Err(OutputError::Input { path: path.to_owned() }) } else { Ok(()) }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn paths_are_followed_to_where_they_lead() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().canonicalize().unwrap();
        fs::create_dir_all(root.join("a/b")).unwrap();
        symlink("a/b", root.join("link")).unwrap();
        symlink("nowhere", root.join("dead")).unwrap();
        let at = |path: &str| resolve(&root.join(path));
        assert_eq!(at("link/new/run").unwrap().path, root.join("a/b/new/run"));
        assert!(at("link/new/run").unwrap().found.is_none());
        // A step up from a link leaves the folder that the link leads to.
        assert_eq!(at("link/../c").unwrap().path, root.join("a/c"));
        assert!(at("./a").unwrap().found.unwrap().is_dir());
        assert!(
            matches!(at("dead/run"), Err(OutputError::DeadLink { link, .. }) if link == root.join("dead"))
        );
        assert!(matches!(at("new/../a"), Err(OutputError::File(_))));
    }
}
