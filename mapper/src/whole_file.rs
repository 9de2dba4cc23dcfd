//! Files that appear whole or not at all.

use std::fs;
use std::path::{Path, PathBuf};

use crate::FileError;

/// Writes beside the file and renames, so that a full disk never leaves half a file.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), FileError> {
    write_together(&[(path.to_owned(), text.to_owned())])
}

/// Writes several files that belong together: none is replaced before all of them are on the disk.
pub(crate) fn write_together<C: AsRef<[u8]>>(files: &[(PathBuf, C)]) -> Result<(), FileError> {
    let written =
        files.iter().try_for_each(|(path, content)| attempt(path, fs::write(partial(path), content)));
    let placed = written
        .and_then(|()| files.iter().try_for_each(|(path, _)| attempt(path, fs::rename(partial(path), path))));
    if placed.is_err() {
        for (path, _) in files {
            // Only left-overs remain if this fails too.
            let _ = fs::remove_file(partial(path));
        }
    }
    placed
}

fn partial(path: &Path) -> PathBuf {
    path.with_added_extension("partial")
}

fn attempt(path: &Path, result: std::io::Result<()>) -> Result<(), FileError> {
    result.map_err(|reason| FileError::Unwritable { path: path.to_owned(), reason })
}
