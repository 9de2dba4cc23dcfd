//! A folder in which the files lie that a reader is given.

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread::LocalKey;

use tempfile::TempDir;

/// Ends one file and begins the next: ASCII calls it the file separator, and no text has it.
const SEPARATOR: u8 = 0x1C;

/// A folder of one target and one thread. The files in it are overwritten again and again.
pub(super) struct Place {
    folder: TempDir,
}

/// Where a thread keeps the place of a target; the folder goes with the thread.
pub(super) type Kept = RefCell<Option<Place>>;

impl Place {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    pub(super) fn folder(&self) -> &Path {
        self.folder.path()
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file in place of an older one.
    pub(super) fn write(&self, name: &str, content: &[u8]) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, content).expect("a file in a temporary folder");
        path
    }

    /// Gives the files that `data` holds one after the other these names; those that it does not come to are removed.
    pub(super) fn write_parts(&self, names: &[&str], data: &[u8]) {
        let mut parts = data.splitn(names.len(), |byte| *byte == SEPARATOR);
        for name in names {
            match parts.next() {
                // A file of no bytes stands for one that is missing.
                Some(content) if !content.is_empty() => drop(self.write(name, content)),
                _ => drop(fs::remove_file(self.path(name))),
            }
        }
    }
}

/// Calls `body` with the place that is `kept`; a new one is first filled by `fill`.
pub(super) fn in_place(kept: &'static LocalKey<Kept>, fill: impl FnOnce(&Place), body: impl FnOnce(&Place)) {
    kept.with_borrow_mut(|kept| {
        let place = kept.get_or_insert_with(|| {
            let place = Place::new();
            fill(&place);
            place
        });
        body(place);
    });
}
