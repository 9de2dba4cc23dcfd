//! The crates of this workspace have no cycles: neither between files nor between the modules of any folder.

use std::fs::read_to_string;
use std::path::Path;

use mba_structure::{CrateTree, cycles};

/// Folders of the members that have a library, as the workspace's manifest lists them.
fn members(root: &Path) -> Vec<String> {
    let manifest = read_to_string(root.join("Cargo.toml")).expect("the workspace has a manifest");
    let start = manifest.find("members = [").expect("it has members");
    let list = &manifest[start..start + manifest[start..].find(']').expect("their list ends")];
    let names = list.split('"').skip(1).step_by(2).map(str::to_owned);
    names.filter(|name| root.join(name).join("src/lib.rs").is_file()).collect()
}

#[test]
fn no_crate_has_a_cycle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let members = members(&root);
    assert!(members.len() >= 10, "{members:?}");
    let mut found = String::new();
    for member in &members {
        let tree = CrateTree::read(member, &root.join(member).join("src")).expect("the sources can be read");
        found.extend(cycles(&tree).iter().map(ToString::to_string));
    }
    assert!(found.is_empty(), "\n{found}");
}
