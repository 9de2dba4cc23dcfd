//! What every kind of source has in common.

use std::fs;
use std::path::{Path, PathBuf};

use mba_io::whole_file::read_text;
use serde::de::DeserializeOwned;

use crate::ImportError;
use crate::destination::Destination;
use crate::facts::Facts;
use crate::options::ImportOptions;
use crate::picture::one_line;

/// A kind of source.
#[derive(Debug)]
pub(crate) struct Format {
    /// Name for people.
    pub(crate) name: &'static str,
    /// What it is recognised by, for people.
    pub(crate) looked_for: &'static str,
    /// Whether a file or folder is of this kind.
    pub(crate) recognise: fn(&Path) -> bool,
    /// Writes images, poses and whatever else into the data set, and says what is known of the cameras.
    pub(crate) read: fn(&Reading<'_>, &mut Destination) -> Result<Facts, ImportError>,
}

/// A source that is being read.
pub(crate) struct Reading<'a> {
    pub(crate) path: &'a Path,
    pub(crate) options: &'a ImportOptions,
    /// Called with what is done and all there is, in bytes or frames.
    pub(crate) progress: &'a dyn Fn(u64, u64),
}

impl Reading<'_> {
    /// Calls `read` for each of the items, and tells how far it is.
    pub(crate) fn each<T>(
        &self,
        items: &[T],
        mut read: impl FnMut(&T) -> Result<(), ImportError>,
    ) -> Result<(), ImportError> {
        for (index, item) in items.iter().enumerate() {
            read(item)?;
            (self.progress)(index as u64 + 1, items.len() as u64);
        }
        Ok(())
    }
}

/// The content of a JSON file.
///
/// # Errors
/// [`ImportError`] when it is unreadable or lacks something.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, ImportError> {
    serde_json::from_str(&read_text(path)?).map_err(|error| ImportError::damaged(path, one_line(&error)))
}

/// Files of a folder whose names begin and end like this, sorted by name.
///
/// # Errors
/// [`ImportError`] when the folder cannot be read.
pub(crate) fn files(folder: &Path, start: &str, endings: &[&str]) -> Result<Vec<PathBuf>, ImportError> {
    let unreadable = |reason| ImportError::unreadable(folder, reason);
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
        if name.starts_with(start) && endings.iter().any(|ending| name.ends_with(ending)) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// The first of these that is a file.
pub(crate) fn first_file(candidates: impl IntoIterator<Item = PathBuf>) -> Option<PathBuf> {
    candidates.into_iter().find(|path| path.is_file())
}

/// The name of a file without folder and ending.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}
