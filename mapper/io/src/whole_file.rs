//! Files that are read at once and within limits, and appear whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use crate::FileError;
use crate::file_kind::kind_of;

/// Bytes of the largest text file that is read: exposures of a million frames.
const LARGEST_TEXT: u64 = 256 << 20;

/// Bytes of the largest binary file that is read.
const LARGEST_BINARY: u64 = 4 << 30;

/// The content of a file that starts with `magic`; of one that starts otherwise no more than that many bytes.
pub fn read(path: &Path, magic: &[u8]) -> Result<Vec<u8>, FileError> {
    let unreadable = |reason| FileError::Unreadable { path: path.to_owned(), reason };
    check_file(path, LARGEST_BINARY)?;
    let mut start = Vec::new();
    let file = File::open(path).map_err(unreadable)?;
    file.take(magic.len() as u64).read_to_end(&mut start).map_err(unreadable)?;
    if start == magic { read_at_most(path, LARGEST_BINARY) } else { Ok(start) }
}

/// The content of a text file in UTF-8. A mark at its beginning is left out, and lines that end with carriage returns
/// alone end with line feeds.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    let encoding = |encoding| FileError::Encoding { path: path.to_owned(), encoding };
    let mut content = read_at_most(path, LARGEST_TEXT)?;
    match content.as_slice() {
        [0xEF, 0xBB, 0xBF, ..] => drop(content.drain(..3)),
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => return Err(encoding("UTF-16".to_owned())),
        _ => {}
    }
    let text = String::from_utf8(content).map_err(|error| {
        let (at, content) = (error.utf8_error().valid_up_to(), error.as_bytes());
        let line = 1 + content[..at].iter().filter(|byte| **byte == b'\n').count();
        encoding(format!("another encoding (byte {:02x} in line {line})", content[at]))
    })?;
    let has_old_line_ends = text.contains('\r') && !text.contains('\n');
    Ok(if has_old_line_ends { text.replace('\r', "\n") } else { text })
}

/// The content of a file of at most `limit` bytes. What is no file, such as a device or pipe, may have no end and is
/// not opened.
pub(crate) fn read_at_most(path: &Path, limit: u64) -> Result<Vec<u8>, FileError> {
    let unreadable = |reason| FileError::Unreadable { path: path.to_owned(), reason };
    let mut content = Vec::with_capacity(check_file(path, limit)? as usize);
    // A file may grow while it is read.
    let read = File::open(path).and_then(|file| file.take(limit + 1).read_to_end(&mut content));
    let bytes = read.map_err(unreadable)? as u64;
    if bytes > limit {
        return Err(FileError::TooLarge { path: path.to_owned(), bytes, limit });
    }
    Ok(content)
}

/// The number of bytes of a file, at most `limit`.
fn check_file(path: &Path, limit: u64) -> Result<u64, FileError> {
    let found =
        fs::metadata(path).map_err(|reason| FileError::Unreadable { path: path.to_owned(), reason })?;
    if !found.is_file() {
        return Err(FileError::NotAFile { path: path.to_owned(), kind: kind_of(found.file_type()) });
    }
    if found.len() > limit {
        return Err(FileError::TooLarge { path: path.to_owned(), bytes: found.len(), limit });
    }
    Ok(found.len())
}

/// Writes a text beside its place and renames, so that a full disk never leaves half a file.
///
/// # Errors
/// [`FileError::Unwritable`].
pub fn write_text(path: &Path, text: &str) -> Result<(), FileError> {
    write_together(&[(path.to_owned(), text.to_owned())])
}

/// Writes several files that belong together: none is replaced before all of them are on the disk.
pub fn write_together<C: AsRef<[u8]>>(files: &[(PathBuf, C)]) -> Result<(), FileError> {
    place(files, |mut file, content| file.write_all(content))
}

/// As [`write_text`], and the content has reached the disk before it replaces the old one: a loss of power leaves
/// one of the two. Slower, for files that cannot be made again.
pub fn write_durably(path: &Path, content: &[u8]) -> Result<(), FileError> {
    place(&[(path.to_owned(), content)], |mut file, content| {
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
    write: impl Fn(File, &[u8]) -> io::Result<()>,
) -> Result<(), FileError> {
    let write_partial = |(path, content): &(PathBuf, C)| {
        attempt(path, open_partial(path).and_then(|file| write(file, content.as_ref())))
    };
    let written = files.iter().try_for_each(write_partial);
    let placed = written.and_then(|()| files.iter().try_for_each(|(path, _)| put_in_place(path)));
    if placed.is_err() {
        files.iter().for_each(|(path, _)| remove_beside(path));
    }
    placed
}

/// Writes the content of `path` beside it, where it waits for [`put_in_place`] or [`remove_beside`].
pub(crate) fn write_beside(path: &Path, content: &[u8]) -> Result<(), FileError> {
    attempt(path, open_partial(path).and_then(|mut file| file.write_all(content)))
}

/// Gives a file that was written beside `path` that name.
pub(crate) fn put_in_place(path: &Path) -> Result<(), FileError> {
    attempt(path, fs::rename(partial(path), path))
}

/// Removes what was written beside `path`; only a left-over remains if this fails.
pub(crate) fn remove_beside(path: &Path) {
    let _ = fs::remove_file(partial(path));
}

/// Opens the file beside `path`. One that a kill left is written anew. A link to a file is not followed: that file is
/// somebody else's.
fn open_partial(path: &Path) -> io::Result<File> {
    let partial = partial(path);
    let is_link = fs::symlink_metadata(&partial).is_ok_and(|found| found.is_symlink());
    if is_link && !fs::metadata(&partial).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        let reason = format!("{} is a link", partial.display());
        return Err(io::Error::new(io::ErrorKind::AlreadyExists, reason));
    }
    OpenOptions::new().write(true).create(true).truncate(true).open(partial)
}

fn partial(path: &Path) -> PathBuf {
    path.with_added_extension("partial")
}

fn attempt(path: &Path, result: io::Result<()>) -> Result<(), FileError> {
    result.map_err(|reason| FileError::Unwritable { path: path.to_owned(), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_above_the_limit_are_refused_before_they_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, "12345").unwrap();
        assert_eq!(read_at_most(&path, 5).unwrap(), b"12345");
        let message = read_at_most(&path, 4).unwrap_err().to_string();
        assert!(message.ends_with("the file has 5 bytes, the most that is read is 4"), "{message}");
        // A hole takes no place on the disk.
        File::create(&path).unwrap().set_len(LARGEST_TEXT + 1).unwrap();
        assert!(
            matches!(read_text(&path), Err(FileError::TooLarge { bytes, .. }) if bytes == LARGEST_TEXT + 1)
        );
    }

    #[test]
    fn texts_of_other_systems_are_read_or_their_encoding_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let read = |content: &[u8]| {
            fs::write(&path, content).unwrap();
            read_text(&path)
        };
        assert_eq!(read(b"\xEF\xBB\xBF1 2\r\n3").unwrap(), "1 2\r\n3");
        assert_eq!(read(b"1 2\r3 4\r").unwrap(), "1 2\n3 4\n");
        let message = read(b"\xFF\xFE1\x00").unwrap_err().to_string();
        assert!(message.ends_with("file is in UTF-16, expected UTF-8"), "{message}");
        let message = read(b"a\nf\xFCr").unwrap_err().to_string();
        assert!(
            message.ends_with("file is in another encoding (byte fc in line 2), expected UTF-8"),
            "{message}"
        );
    }

    #[test]
    fn of_a_file_that_starts_wrong_only_the_start_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, "ply and more").unwrap();
        assert_eq!(read(&path, b"ply").unwrap(), b"ply and more");
        assert_eq!(read(&path, b"obj").unwrap(), b"ply");
    }

    #[cfg(unix)]
    #[test]
    fn what_has_no_end_is_not_opened() {
        for (path, kind) in [("/dev/zero", "device"), ("/", "folder")] {
            let message = read(Path::new(path), b"ply").unwrap_err().to_string();
            assert_eq!(message, format!("cannot read {path}: it is a {kind}, not a file"));
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_beside_the_place_is_not_written_through() {
        let folder = tempfile::tempdir().unwrap();
        let [path, other] = ["file", "other"].map(|name| folder.path().join(name));
        fs::write(&other, "mine").unwrap();
        std::os::unix::fs::symlink(&other, partial(&path)).unwrap();
        assert!(matches!(write_text(&path, "new"), Err(FileError::Unwritable { .. })));
        assert_eq!(fs::read(&other).unwrap(), b"mine");
        write_text(&path, "new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }
}
