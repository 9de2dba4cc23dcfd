//! Folders that may hold files of others, with a list of what was written there.

use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use super::folder::Layout;
use super::{OutputError, OutputFolder, Permission};
use crate::FileError;
use crate::whole_file::{read_text, write_text};

/// How a command lists the files that it wrote into a folder.
#[derive(Debug)]
pub(super) struct FileList {
    /// Name of the list in the folder.
    pub(super) file: &'static str,
    /// Its first line, by which it is recognised.
    pub(super) title: &'static str,
    /// Whether the command writes files of such a name. Other names on a list are not believed.
    pub(super) is_plain: fn(&str) -> bool,
}

impl FileList {
    /// The names on the list of a folder, if it has one.
    pub(super) fn read(&self, folder: &Path) -> Option<BTreeSet<String>> {
        let text = read_text(&folder.join(self.file)).ok()?;
        let mut lines = text.lines();
        if lines.next() != Some(self.title) {
            return None;
        }
        Some(lines.filter(|name| (self.is_plain)(name)).map(str::to_owned).collect())
    }

    fn write(&self, folder: &Path, names: &BTreeSet<String>) -> Result<(), FileError> {
        let lines: String = names.iter().map(|name| format!("{name}\n")).collect();
        write_text(&folder.join(self.file), &format!("{}\n{lines}", self.title))
    }
}

/// A claimed folder with a list, locked until this is dropped. Nothing in it has been changed.
#[derive(Debug)]
pub(super) struct ListedFolder {
    list: &'static FileList,
    folder: OutputFolder,
    earlier: BTreeSet<String>,
    names: BTreeSet<String>,
}

impl ListedFolder {
    /// Claims `path`, a new or empty folder or one with such a list, for files of these names.
    ///
    /// # Errors
    /// See [`OutputError`]; [`OutputError::Foreign`] also where a file of one of the names is there and not on the list.
    pub(super) fn claim(
        path: &Path,
        permission: &Permission<'_>,
        (layout, list): (&Layout, &'static FileList),
        names: impl IntoIterator<Item = String>,
    ) -> Result<Self, OutputError> {
        let folder = OutputFolder::claim(path, permission, layout)?;
        let names: BTreeSet<String> = names.into_iter().collect();
        let earlier = list.read(path).unwrap_or_default();
        let is_foreign = |name: &&String| !earlier.contains(*name) && path.join(name).exists();
        if let (false, Some(name)) = (permission.force, names.iter().find(is_foreign)) {
            return Err(OutputError::Foreign { path: path.to_owned(), found: name.clone() });
        }
        Ok(Self { list, folder, earlier, names })
    }

    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Names of the files that are to come.
    pub(super) fn names(&self) -> &BTreeSet<String> {
        &self.names
    }

    /// Lists earlier files and those to come: whatever is written from here on is on the list, also if this process ends before
    /// it is done.
    ///
    /// # Errors
    /// When the list cannot be written.
    pub(super) fn begin(&self) -> Result<(), OutputError> {
        Ok(self.list.write(self.path(), &self.earlier.union(&self.names).cloned().collect())?)
    }

    /// Names of the earlier files that were not written again.
    pub(super) fn left_over(&self) -> impl Iterator<Item = &String> {
        self.earlier.difference(&self.names)
    }

    /// Lists the files that were written, and no others.
    ///
    /// # Errors
    /// When the list cannot be written.
    pub(super) fn end(&self) -> Result<(), OutputError> {
        Ok(self.list.write(self.path(), &self.names)?)
    }
}

/// Removes a file, if it is there.
pub(super) fn remove(path: &Path) -> Result<(), OutputError> {
    match fs::remove_file(path) {
        Err(reason) if reason.kind() != ErrorKind::NotFound => Err(OutputError::unwritable(path, reason)),
        _ => Ok(()),
    }
}
