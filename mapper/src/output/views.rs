//! A folder of rendered views, with a list of what was written.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::folder::Layout;
use super::{OutputError, OutputFolder, Permission};
use crate::FileError;
use crate::run::DEPTH_FOLDER;
use crate::whole_file::{read_text, write_text};

/// Name of the list of views.
const LIST_FILE: &str = ".mba-views";

/// First line of the list.
const TITLE: &str = "views that mba wrote, here and in depth/";

const VIEWS: Layout = Layout { recognise: |folder| read_list(folder).is_some(), folders: &[DEPTH_FOLDER] };

/// A folder of colour images, with depth images of the same names in `depth`, locked until this is dropped.
#[derive(Debug)]
pub struct ViewFolder {
    folder: OutputFolder,
    earlier: BTreeSet<String>,
    names: BTreeSet<String>,
}

impl ViewFolder {
    /// Claims `path`, a new or empty folder or one with earlier views, for images of these names, and makes it.
    ///
    /// # Errors
    /// See [`OutputError`].
    pub fn claim(
        path: &Path,
        permission: &Permission<'_>,
        names: impl IntoIterator<Item = String>,
    ) -> Result<Self, OutputError> {
        let folder = OutputFolder::claim(path, permission, &VIEWS)?;
        let names: BTreeSet<String> = names.into_iter().collect();
        let earlier = read_list(path).unwrap_or_default();
        let is_foreign = |name: &&String| !earlier.contains(*name) && path.join(name).exists();
        if let (false, Some(name)) = (permission.force, names.iter().find(is_foreign)) {
            return Err(OutputError::Foreign { path: path.to_owned(), found: name.clone() });
        }
        let depth = path.join(DEPTH_FOLDER);
        fs::create_dir_all(&depth).map_err(|reason| OutputError::unwritable(&depth, reason))?;
        // Whatever is written from here on is on the list, also if this process ends before it is done.
        write_list(path, &earlier.union(&names).cloned().collect())?;
        Ok(Self { folder, earlier, names })
    }

    /// Where the colour and the depth image of a name belong.
    #[must_use]
    pub fn paths(&self, name: &str) -> [PathBuf; 2] {
        [self.folder.path().join(name), self.folder.path().join(DEPTH_FOLDER).join(name)]
    }

    /// Removes the views of earlier times that were not written again.
    ///
    /// # Errors
    /// When a file cannot be removed or the list not be written.
    pub fn finish(self) -> Result<(), OutputError> {
        for name in self.earlier.difference(&self.names) {
            for path in self.paths(name) {
                match fs::remove_file(&path) {
                    Err(reason) if reason.kind() != std::io::ErrorKind::NotFound => {
                        return Err(OutputError::unwritable(&path, reason));
                    }
                    _ => {}
                }
            }
        }
        Ok(write_list(self.folder.path(), &self.names)?)
    }
}

fn write_list(folder: &Path, names: &BTreeSet<String>) -> Result<(), FileError> {
    let lines: String = names.iter().map(|name| format!("{name}\n")).collect();
    write_text(&folder.join(LIST_FILE), &format!("{TITLE}\n{lines}"))
}

/// The list of a folder, if it has one; names that are no plain ones of images are not believed.
fn read_list(folder: &Path) -> Option<BTreeSet<String>> {
    let text = read_text(&folder.join(LIST_FILE)).ok()?;
    let mut lines = text.lines();
    if lines.next() != Some(TITLE) {
        return None;
    }
    let is_plain = |name: &&str| name.ends_with(".png") && !name.contains(['/', '\\']);
    Some(lines.filter(is_plain).map(str::to_owned).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(folder: &Path, names: &[&str]) -> Result<ViewFolder, OutputError> {
        ViewFolder::claim(folder, &Permission::default(), names.iter().map(|name| (*name).to_owned()))
    }

    #[test]
    fn earlier_views_go_and_other_files_stay() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("views");
        let write = |views: &ViewFolder, name: &str| {
            views.paths(name).iter().for_each(|path| fs::write(path, "x").unwrap());
        };
        let views = claim(&folder, &["a.png", "b.png"]).unwrap();
        write(&views, "a.png");
        write(&views, "b.png");
        views.finish().unwrap();
        for name in ["notes.txt", "c.png", "depth/d.png"] {
            fs::write(folder.join(name), "mine").unwrap();
        }
        let views = claim(&folder, &["b.png"]).unwrap();
        write(&views, "b.png");
        views.finish().unwrap();
        let exists = |name: &str| folder.join(name).exists();
        assert!(!exists("a.png") && !exists("depth/a.png"));
        assert!(
            ["b.png", "depth/b.png", "notes.txt", "c.png", "depth/d.png"].iter().all(|name| exists(name))
        );
        let refused = claim(&folder, &["c.png"]).unwrap_err().to_string();
        assert!(refused.contains("it holds c.png"), "{refused}");
    }

    #[test]
    fn a_list_names_images_only() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(LIST_FILE), format!("{TITLE}\n../b.png\na.png\na.txt\n")).unwrap();
        assert_eq!(read_list(folder.path()), Some(BTreeSet::from(["a.png".to_owned()])));
    }
}
