//! A folder in the layout of another program, with a list of what was written.

use std::fs;
use std::path::{Component, Path, PathBuf};

use super::folder::Layout;
use super::listed::{FileList, ListedFolder, remove};
use super::{OutputError, Permission};
use crate::FileError;
use crate::whole_file::{put_in_place, remove_beside, write_beside};

const LIST: FileList = FileList { file: ".mba-export", title: "files that mba export wrote", is_plain };

/// Folders that an export may have, those inside of others after them.
const FOLDERS: [&str; 4] = ["images", "depth", "sparse", "sparse/0"];

const EXPORT: Layout = Layout { recognise: |folder| LIST.read(folder).is_some(), folders: &FOLDERS };

/// A folder for the files of an export, locked until this is dropped.
///
/// An earlier export stays as it is until all files of the new one are on the disk, beside their places.
#[derive(Debug)]
pub struct ExportFolder {
    folder: ListedFolder,
    /// Written beside their places.
    waiting: Vec<PathBuf>,
}

impl ExportFolder {
    /// Claims `path`, a new or empty folder or one with an earlier export, for files of these names, and makes it. Names
    /// are relative to `path`, with `/`, in it or in `images`, `depth` or `sparse/0`.
    ///
    /// # Errors
    /// See [`OutputError`].
    pub fn claim(
        path: &Path,
        permission: &Permission<'_>,
        names: impl IntoIterator<Item = String>,
    ) -> Result<Self, OutputError> {
        let folder = ListedFolder::claim(path, permission, (&EXPORT, &LIST), names)?;
        for inner in folder.names().iter().filter_map(|name| path.join(name).parent().map(Path::to_owned)) {
            fs::create_dir_all(&inner).map_err(|reason| OutputError::unwritable(&inner, reason))?;
        }
        Ok(Self { folder, waiting: Vec::new() })
    }

    /// Writes the content of a file beside its place, where it waits for [`Self::finish`].
    ///
    /// # Errors
    /// [`FileError::Unwritable`].
    pub fn write(&mut self, name: &str, content: &[u8]) -> Result<(), FileError> {
        let path = self.folder.path().join(name);
        self.waiting.push(path.clone());
        write_beside(&path, content)
    }

    /// Puts all files in their places and removes those of an earlier export that were not written again.
    ///
    /// # Errors
    /// When a file cannot be renamed or removed, or the list not be written.
    pub fn finish(mut self) -> Result<(), OutputError> {
        self.folder.begin()?;
        for path in std::mem::take(&mut self.waiting) {
            put_in_place(&path)?;
        }
        for name in self.folder.left_over() {
            let path = self.folder.path().join(name);
            remove_beside(&path);
            remove(&path)?;
        }
        remove_empty(self.folder.path());
        self.folder.end()
    }
}

impl Drop for ExportFolder {
    fn drop(&mut self) {
        let path = self.folder.path();
        self.waiting.iter().for_each(|path| remove_beside(path));
        remove_empty(path);
    }
}

/// Removes the folders of an export that hold nothing.
fn remove_empty(path: &Path) {
    for name in FOLDERS.iter().rev() {
        let _ = fs::remove_dir(path.join(name));
    }
}

/// Whether a name is that of a file in the folder or in one that an export may have.
fn is_plain(name: &str) -> bool {
    let path = Path::new(name);
    let parent = path.parent().unwrap_or(path);
    path.components().all(|part| matches!(part, Component::Normal(_)))
        && !name.contains('\\')
        && path.extension().is_some()
        && (parent.as_os_str().is_empty() || FOLDERS.iter().any(|folder| parent == Path::new(folder)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(folder: &Path, force: bool, names: &[&str]) -> Result<ExportFolder, OutputError> {
        let permission = Permission { force, inputs: &[] };
        ExportFolder::claim(folder, &permission, names.iter().map(|name| (*name).to_owned()))
    }

    fn export(folder: &Path, names: &[&str], content: &str) {
        let mut files = claim(folder, false, names).unwrap();
        names.iter().for_each(|name| files.write(name, content.as_bytes()).unwrap());
        files.finish().unwrap();
    }

    fn read(path: PathBuf) -> Option<String> {
        fs::read_to_string(path).ok()
    }

    #[test]
    fn an_export_replaces_the_earlier_one_and_nothing_else() {
        let place = tempfile::tempdir().unwrap();
        let out = place.path().join("new/out");
        export(&out, &["transforms.json", "images/1.png", "depth/1.png"], "first");
        fs::write(out.join("images/mine.png"), "mine").unwrap();
        export(&out, &["sparse/0/images.txt", "images/2.png"], "second");
        assert_eq!(read(out.join("sparse/0/images.txt")).as_deref(), Some("second"));
        assert_eq!(read(out.join("images/mine.png")).as_deref(), Some("mine"));
        for gone in ["transforms.json", "images/1.png", "depth"] {
            assert!(!out.join(gone).exists(), "{gone}");
        }
        assert!(matches!(claim(&out, false, &["images/mine.png"]), Err(OutputError::Foreign { .. })));
    }

    #[test]
    fn one_that_is_given_up_leaves_what_was_there() {
        let place = tempfile::tempdir().unwrap();
        let out = place.path().join("out");
        drop(claim(&out, false, &["images/1.png"]).unwrap());
        assert!(!out.exists());
        export(&out, &["images/1.png"], "first");
        let mut files = claim(&out, false, &["images/1.png", "depth/1.png"]).unwrap();
        files.write("images/1.png", b"second").unwrap();
        files.write("depth/1.png", b"second").unwrap();
        assert_eq!(read(out.join("images/1.png")).as_deref(), Some("first"));
        drop(files);
        assert_eq!(read(out.join("images/1.png")).as_deref(), Some("first"));
        assert_eq!(fs::read_dir(out.join("images")).unwrap().count(), 1);
        assert!(!out.join("depth").exists());
    }

    #[test]
    fn folders_of_others_are_refused_and_lists_are_not_believed() {
        let place = tempfile::tempdir().unwrap();
        fs::create_dir(place.path().join("images")).unwrap();
        fs::write(place.path().join("images/mine.png"), "mine").unwrap();
        assert!(matches!(claim(place.path(), false, &["a.txt"]), Err(OutputError::Foreign { .. })));
        // Images of others are not mixed with those that come, not even by force.
        assert!(matches!(claim(place.path(), true, &["a.txt"]), Err(OutputError::Foreign { .. })));
        let names = "../a.txt\n/a.txt\nrgb/1.png\nimages/../a.txt\nimages\nimages\\1.png\nimages/1.png\n";
        fs::write(place.path().join(LIST.file), format!("{}\n{names}", LIST.title)).unwrap();
        assert_eq!(LIST.read(place.path()).unwrap().into_iter().collect::<Vec<_>>(), ["images/1.png"]);
    }
}
