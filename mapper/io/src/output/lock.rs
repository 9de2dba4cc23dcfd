//! One process at a time writes a folder.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use super::OutputError;

/// Name of the file that is locked.
const LOCK_FILE: &str = ".mba-lock";

/// What the file starts with, before the number of the process.
const MAGIC: &str = "mba is writing this folder, process ";

/// Times that the file may vanish between opening and locking it, because others finish, before that is an error.
const ATTEMPTS: usize = 100;

/// The lock of a folder. The operating system gives it up when the process ends, so that one that was killed leaves a
/// file but no lock.
#[derive(Debug)]
pub(super) struct Lock {
    path: PathBuf,
    /// Locked as long as it is open.
    file: Option<File>,
}

/// Whether `name` is that of a lock.
pub(crate) fn is_lock(name: &std::ffi::OsStr) -> bool {
    name == LOCK_FILE
}

/// Whether `folder` has the lock file of this program, locked or not.
pub(super) fn has_lock_file(folder: &Path) -> bool {
    let path = folder.join(LOCK_FILE);
    if !fs::symlink_metadata(&path).is_ok_and(|found| found.is_file()) {
        return false;
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(MAGIC.len() as u64).read_to_end(&mut start));
    // A process that was killed at once left an empty one.
    read.is_ok() && (start.is_empty() || start == MAGIC.as_bytes())
}

impl Lock {
    /// Locks `folder`, which exists; `out` is its name for the user.
    pub(super) fn take(folder: &Path, out: &Path) -> Result<Self, OutputError> {
        let path = folder.join(LOCK_FILE);
        let unwritable = |reason| OutputError::unwritable(out, reason);
        if !has_lock_file(folder) && fs::symlink_metadata(&path).is_ok() {
            return Err(OutputError::Foreign { path: out.to_owned(), found: LOCK_FILE.to_owned() });
        }
        for _ in 0..ATTEMPTS {
            let mut file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(&path)
                .map_err(unwritable)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => {
                    return Err(OutputError::InUse { path: out.to_owned(), pid: pid(&mut file) });
                }
                // A file system without locks: better none than no results.
                Err(TryLockError::Error(_)) => {
                    return Ok(Self { path, file: None });
                }
                Ok(()) => {}
            }
            // Another process may have finished, and removed the file, between opening and locking it.
            if !is_still_there(&file, &path) {
                continue;
            }
            let lock = Self { path, file: Some(file) };
            lock.sign().map_err(unwritable)?;
            return Ok(lock);
        }
        Err(OutputError::InUse { path: out.to_owned(), pid: None })
    }

    /// Writes the number of this process into the file.
    fn sign(&self) -> io::Result<()> {
        let Some(mut file) = self.file.as_ref() else { return Ok(()) };
        file.set_len(0)?;
        file.write_all(format!("{MAGIC}{}\n", std::process::id()).as_bytes())
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Before it is unlocked; a file that stays is taken for that of a process that was killed.
        let _ = fs::remove_file(&self.path);
        self.file = None;
    }
}

/// The process that wrote the file.
fn pid(file: &mut File) -> Option<u32> {
    let mut text = String::new();
    file.take(MAGIC.len() as u64 + 20).read_to_string(&mut text).ok()?;
    text.strip_prefix(MAGIC)?.trim().parse().ok()
}

#[cfg(unix)]
fn is_still_there(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |found: io::Result<fs::Metadata>| found.map(|found| (found.dev(), found.ino())).ok();
    id(file.metadata()).is_some_and(|own| id(fs::symlink_metadata(path)) == Some(own))
}

#[cfg(not(unix))]
fn is_still_there(_: &File, path: &Path) -> bool {
    path.is_file()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_locked_once_until_the_lock_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let lock = Lock::take(folder.path(), folder.path()).unwrap();
        let refused = Lock::take(folder.path(), Path::new("out")).unwrap_err();
        let pid = std::process::id();
        assert_eq!(
            refused.to_string(),
            format!("cannot write out: another process is writing it, process {pid}")
        );
        drop(lock);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        drop(Lock::take(folder.path(), folder.path()).unwrap());
    }

    #[test]
    fn the_file_of_a_killed_process_is_no_lock_but_somebody_elses_file_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOCK_FILE);
        fs::write(&path, format!("{MAGIC}1\n")).unwrap();
        assert!(has_lock_file(folder.path()));
        drop(Lock::take(folder.path(), folder.path()).unwrap());
        fs::write(&path, "mine").unwrap();
        assert!(matches!(Lock::take(folder.path(), folder.path()), Err(OutputError::Foreign { .. })));
        assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    }
}
