//! A folder of rendered views, with a list of what was written.

use std::fs;
use std::path::{Path, PathBuf};

use super::folder::Layout;
use super::listed::{FileList, ListedFolder, remove};
use super::{OutputError, Permission};
use crate::run_layout::DEPTH_FOLDER;

const LIST: FileList = FileList {
    file: ".mba-views",
    title: "views that mba wrote, here and in depth/",
    is_plain: |name| name.ends_with(".png") && !name.contains(['/', '\\']),
};

const VIEWS: Layout = Layout { recognise: |folder| LIST.read(folder).is_some(), folders: &[DEPTH_FOLDER] };

/// A folder of colour images, with depth images of the same names in `depth`, locked until this is dropped.
#[derive(Debug)]
pub struct ViewFolder(ListedFolder);

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
        let folder = ListedFolder::claim(path, permission, (&VIEWS, &LIST), names)?;
        let depth = path.join(DEPTH_FOLDER);
        fs::create_dir_all(&depth).map_err(|reason| OutputError::unwritable(&depth, reason))?;
        folder.begin()?;
        Ok(Self(folder))
    }

    /// Where the colour and the depth image of a name belong.
    #[must_use]
    pub fn paths(&self, name: &str) -> [PathBuf; 2] {
        [self.0.path().join(name), self.0.path().join(DEPTH_FOLDER).join(name)]
    }

    /// Removes the views of earlier times that were not written again.
    ///
    /// # Errors
    /// When a file cannot be removed or the list not be written.
    pub fn finish(self) -> Result<(), OutputError> {
        for name in self.0.left_over() {
            self.paths(name).iter().try_for_each(|path| remove(path))?;
        }
        self.0.end()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

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
        fs::write(folder.path().join(LIST.file), format!("{}\n../b.png\na.png\na.txt\n", LIST.title))
            .unwrap();
        assert_eq!(LIST.read(folder.path()), Some(BTreeSet::from(["a.png".to_owned()])));
    }
}
