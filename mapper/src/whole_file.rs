//! Files that are read at once, and appear whole or not at all.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::FileError;

/// The content of a file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, FileError> {
    fs::read(path).map_err(|reason| FileError::Unreadable { path: path.to_owned(), reason })
}

/// The content of a text file in UTF-8.
pub(crate) fn read_text(path: &Path) -> Result<String, FileError> {
    fs::read_to_string(path).map_err(|reason| FileError::Unreadable { path: path.to_owned(), reason })
}

/// Writes beside the file and renames, so that a full disk never leaves half a file.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), FileError> {
    write_together(&[(path.to_owned(), text.to_owned())])
}

/// Writes several files that belong together: none is replaced before all of them are on the disk.
pub(crate) fn write_together<C: AsRef<[u8]>>(files: &[(PathBuf, C)]) -> Result<(), FileError> {
    place(files, |path, content| fs::write(path, content))
}

/// As [`write_whole`], and the content has reached the disk before it replaces the old one: a loss of power leaves
/// one of the two. Slower, for files that cannot be made again.
pub(crate) fn write_durably(path: &Path, content: &[u8]) -> Result<(), FileError> {
    place(&[(path.to_owned(), content)], |path, content| {
        let mut file = File::create(path)?;
        file.write_all(content)?;
        file.sync_all()
    })?;
    // Not all systems can open or flush a folder; without it the new name may be lost, not the old file.
    let _ = path.parent().map(|folder| File::open(folder).and_then(|folder| folder.sync_all()));
    Ok(())
}

/// Writes all files beside their places with `write`, then renames all of them.
fn place<C: AsRef<[u8]>>(
    files: &[(PathBuf, C)],
    write: impl Fn(&Path, &[u8]) -> io::Result<()>,
) -> Result<(), FileError> {
    let written =
        files.iter().try_for_each(|(path, content)| attempt(path, write(&partial(path), content.as_ref())));
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

fn attempt(path: &Path, result: io::Result<()>) -> Result<(), FileError> {
    result.map_err(|reason| FileError::Unwritable { path: path.to_owned(), reason })
}
