//! One file that may be written.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use super::place::resolve;
use super::{OutputError, Permission};
use crate::FileError;
use crate::file_kind::kind_of;
use crate::whole_file::write_together;

/// Bytes of an existing file that it is recognised by.
const HEADER_BYTES: u64 = 1024;

/// A file, device or pipe that may be written. Nothing has been changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputFile {
    /// As it was named.
    shown: PathBuf,
    target: Target,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Target {
    /// A new or earlier file, links followed.
    File(PathBuf),
    /// A pipe or a device, which is written to and not replaced.
    Stream(PathBuf),
    /// Named `-`.
    Stdout,
}

impl OutputFile {
    /// Claims `path`: a new file, one that begins as `is_own` recognises, a pipe, a device, or `-` for the standard
    /// output.
    ///
    /// # Errors
    /// See [`OutputError`]; nothing has changed then.
    pub fn claim(
        path: &Path,
        permission: &Permission<'_>,
        is_own: impl Fn(&[u8]) -> bool,
    ) -> Result<Self, OutputError> {
        let shown = path.to_owned();
        if path == Path::new("-") {
            return Ok(Self { shown, target: Target::Stdout });
        }
        let place = resolve(path)?;
        place.check_recordings(path, permission.inputs)?;
        place.check_inputs(path, permission.inputs)?;
        let target = match place.found {
            None => {
                // Where the folder is missing, or is a file, nothing can be written later either.
                let folder = place.path.parent().unwrap_or(Path::new("/"));
                fs::read_dir(folder).map_err(|reason| OutputError::unwritable(path, reason))?;
                Target::File(place.path)
            }
            Some(found) if found.is_file() => {
                if !permission.force
                    && !begins(&place.path, &is_own)
                        .map_err(|reason| OutputError::unwritable(path, reason))?
                {
                    let found = "something else".to_owned();
                    return Err(OutputError::Foreign { path: shown, found });
                }
                Target::File(place.path)
            }
            Some(found) => match kind_of(found) {
                "pipe" | "device" => Target::Stream(place.path),
                kind => return Err(OutputError::NotAFile { path: shown, kind }),
            },
        };
        Ok(Self { shown, target })
    }

    /// Whether the content goes to the standard output, where nothing else should go then.
    #[must_use]
    pub fn is_stdout(&self) -> bool {
        self.target == Target::Stdout
    }

    /// Whether the content goes into a pipe, a device or the standard output.
    #[must_use]
    pub fn is_stream(&self) -> bool {
        !matches!(self.target, Target::File(_))
    }

    /// Writes the content: a file appears whole or not at all. A reader of the standard output that has gone away is
    /// no error.
    ///
    /// # Errors
    /// [`FileError::Unwritable`].
    pub fn write(&self, content: &[u8]) -> Result<(), FileError> {
        let unwritable = |reason| FileError::Unwritable { path: self.shown.clone(), reason };
        match &self.target {
            Target::File(path) => match write_together(&[(path.clone(), content)]) {
                Err(FileError::Unwritable { reason, .. }) => Err(unwritable(reason)),
                other => other,
            },
            Target::Stream(path) => {
                let opened = OpenOptions::new().write(true).open(path);
                opened.and_then(|mut stream| stream.write_all(content)).map_err(unwritable)
            }
            Target::Stdout => match io::stdout().lock().write_all(content) {
                // `| head` has seen enough.
                Err(reason) if reason.kind() != io::ErrorKind::BrokenPipe => Err(unwritable(reason)),
                _ => Ok(()),
            },
        }
    }
}

/// Whether a file begins as `is_own` recognises; an empty one holds nothing that could be lost.
fn begins(path: &Path, is_own: impl Fn(&[u8]) -> bool) -> io::Result<bool> {
    let mut start = Vec::new();
    File::open(path)?.take(HEADER_BYTES).read_to_end(&mut start)?;
    Ok(start.is_empty() || is_own(&start))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(path: &Path, force: bool) -> Result<OutputFile, OutputError> {
        OutputFile::claim(path, &Permission { force, inputs: &[] }, |start| start.starts_with(b"own"))
    }

    #[test]
    fn only_own_files_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh");
        claim(&path, false).unwrap().write(b"own 1").unwrap();
        claim(&path, false).unwrap().write(b"own 2").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"own 2");
        fs::write(&path, "a letter").unwrap();
        assert!(matches!(claim(&path, false), Err(OutputError::Foreign { .. })));
        assert_eq!(fs::read(&path).unwrap(), b"a letter");
        claim(&path, true).unwrap().write(b"own 3").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"own 3");
        assert!(matches!(claim(folder.path(), true), Err(OutputError::NotAFile { kind: "folder", .. })));
        assert!(matches!(claim(&folder.path().join("no/mesh"), true), Err(OutputError::File(_))));
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_devices_written_to() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("there"), "own").unwrap();
        symlink("there", at("link")).unwrap();
        claim(&at("link"), false).unwrap().write(b"own new").unwrap();
        assert!(fs::symlink_metadata(at("link")).unwrap().is_symlink());
        assert_eq!(fs::read(at("there")).unwrap(), b"own new");
        claim(Path::new("/dev/null"), false).unwrap().write(b"own").unwrap();
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
        let full = claim(Path::new("/dev/full"), false).unwrap().write(b"own").unwrap_err();
        assert!(
            matches!(full, FileError::Unwritable { reason, .. } if reason.kind() == io::ErrorKind::StorageFull)
        );
    }
}
