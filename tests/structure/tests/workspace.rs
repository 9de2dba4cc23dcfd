//! The crates of this workspace have no cycles, neither between files nor between the modules of any folder, and can be known as a
//! whole.

use std::collections::BTreeMap;
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

fn crates() -> Vec<CrateTree> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let members = members(&root);
    assert!(members.len() >= 10, "{members:?}");
    let read = |name: &String| CrateTree::read(name, &root.join(name).join("src"));
    members.iter().map(|name| read(name).expect("the sources can be read")).collect()
}

#[test]
fn no_crate_has_a_cycle() {
    let found: String = crates().iter().flat_map(cycles).map(|cycle| cycle.to_string()).collect();
    assert!(found.is_empty(), "\n{found}");
}

/// Lines of a crate, without its tests, that someone can still know.
const MOST_LINES: usize = 8000;

#[test]
fn no_crate_is_too_large_to_know() {
    let lines = crates().iter().map(|tree| (tree.name().to_owned(), tree.lines())).collect::<Vec<_>>();
    assert!(lines.iter().all(|(_, lines)| *lines > 0), "{lines:?}");
    let too_large = lines.iter().filter(|(_, lines)| *lines > MOST_LINES).collect::<Vec<_>>();
    assert!(too_large.is_empty(), "{too_large:?} are more than {MOST_LINES} lines");
}

#[test]
fn a_name_of_a_type_has_one_owner() {
    let mut owners = BTreeMap::<String, Vec<String>>::new();
    // What only tests and benches use is not met together with the rest.
    let is_product = |tree: &&CrateTree| !(tree.name().starts_with("tests") || tree.name() == "benches");
    for tree in crates().iter().filter(is_product) {
        for name in tree.public_types() {
            owners.entry(name.clone()).or_default().push(tree.name().to_owned());
        }
    }
    owners.retain(|_, owners| owners.len() > 1);
    assert!(owners.is_empty(), "{owners:#?}");
}
