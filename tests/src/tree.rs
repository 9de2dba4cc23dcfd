//! What a folder holds, so that it can be compared before and after.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// What lies at a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Item {
    /// A file with its content.
    File(Vec<u8>),
    /// A folder.
    Folder,
    /// A link with what it leads to.
    Link(PathBuf),
    /// A pipe, a device or a socket.
    Other,
}

/// Everything below `folder`, by relative path; links are not followed.
///
/// # Panics
/// When something cannot be read.
#[must_use]
pub fn tree(folder: &Path) -> BTreeMap<PathBuf, Item> {
    let mut items = BTreeMap::new();
    collect(folder, Path::new(""), &mut items);
    items
}

fn collect(root: &Path, at: &Path, items: &mut BTreeMap<PathBuf, Item>) {
    for entry in fs::read_dir(root.join(at)).expect("a folder") {
        let entry = entry.expect("an entry");
        let (path, kind) = (at.join(entry.file_name()), entry.file_type().expect("a type"));
        let whole = root.join(&path);
        let item = if kind.is_dir() {
            collect(root, &path, items);
            Item::Folder
        } else if kind.is_symlink() {
            Item::Link(fs::read_link(whole).expect("a link"))
        } else if kind.is_file() {
            Item::File(fs::read(whole).expect("a file"))
        } else {
            Item::Other
        };
        items.insert(path, item);
    }
}

/// The paths whose content differs, or that only one of the two has.
#[must_use]
pub fn differences(before: &BTreeMap<PathBuf, Item>, after: &BTreeMap<PathBuf, Item>) -> Vec<PathBuf> {
    let mut paths: Vec<PathBuf> = before.keys().chain(after.keys()).cloned().collect();
    paths.sort();
    paths.dedup();
    paths.retain(|path| before.get(path) != after.get(path));
    paths
}

/// Copies everything below `from`, links as links, into the new folder `to`.
///
/// # Panics
/// When something cannot be read or written.
pub fn copy(from: &Path, to: &Path) {
    fs::create_dir(to).expect("a new folder");
    for (path, item) in tree(from) {
        let to = to.join(&path);
        match item {
            Item::File(content) => fs::write(to, content).expect("a file"),
            Item::Folder => fs::create_dir(to).expect("a folder"),
            Item::Link(target) => link(&target, &to),
            Item::Other => panic!("{} cannot be copied", path.display()),
        }
    }
}

#[cfg(unix)]
fn link(target: &Path, at: &Path) {
    std::os::unix::fs::symlink(target, at).expect("a link");
}

#[cfg(not(unix))]
fn link(_: &Path, at: &Path) {
    panic!("{}: links are not tested here", at.display());
}
