//! The crates of this workspace have no cycles: neither between files nor between the modules of any folder.

use std::path::Path;

use mba_structure::{CrateTree, cycles};

#[track_caller]
fn assert_no_cycles(folder: &str) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let tree = CrateTree::read(folder, &root.join(folder).join("src")).expect("the sources can be read");
    assert!(!tree.dependencies().is_empty(), "{folder} was not read");
    let text: String = cycles(&tree).iter().map(ToString::to_string).collect();
    assert!(text.is_empty(), "\n{text}");
}

#[test]
fn the_mapper_goes_one_way() {
    assert_no_cycles("mapper");
}

#[test]
fn the_finder_goes_one_way() {
    assert_no_cycles("tests/structure");
}
