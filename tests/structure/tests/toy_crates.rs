//! Cycles of crates that are small enough to see them.

use mba_structure::{CrateTree, Cycle, cycles};

fn cycles_of(sources: &[(&str, &str)]) -> Vec<Cycle> {
    cycles(&CrateTree::from_sources("toy", sources))
}

#[test]
fn what_goes_one_way_has_no_cycle() {
    let sources = [
        ("lib.rs", "pub mod low; pub mod high; pub use high::High;"),
        ("low.rs", "pub struct Low;"),
        (
            "high.rs",
            "use crate::low::Low; pub struct High(Low); #[cfg(test)] mod tests { use crate::high::High; }",
        ),
    ];
    assert_eq!(cycles_of(&sources), []);
}

#[test]
fn lines_of_tests_are_not_counted() {
    let sources = [
        ("lib.rs", "mod low;\n#[cfg(test)]\nmod more_tests;\n\nfn f() {}\n"),
        ("low.rs", "pub struct Low;\n\n#[cfg(test)]\nmod tests {\n    use super::*;\n}\n"),
    ];
    // Five of the first file, and one of the second: the empty line belongs to its tests.
    assert_eq!(CrateTree::from_sources("toy", &sources).lines(), 6);
}

#[test]
fn a_reexport_is_no_dependency_and_leads_to_the_file_behind_it() {
    // Both siblings come through mod.rs; only one needs the other.
    let sources = [
        ("lib.rs", "mod map;"),
        ("map/mod.rs", "mod store; mod file; pub use store::Store; pub use file::{read as read_map, write};"),
        ("map/store.rs", "pub struct Store;"),
        ("map/file.rs", "use super::Store; pub fn read() -> Store {} pub fn write(_: &Store) {}"),
    ];
    assert_eq!(cycles_of(&sources), []);
}

#[test]
fn a_path_in_a_body_closes_a_circle() {
    let sources = [
        ("lib.rs", "mod map;"),
        ("map/mod.rs", "mod store; mod file; pub use store::Store; pub use file::read as read_map;"),
        ("map/store.rs", "pub struct Store; impl Store { fn new() -> Self { super::read_map() } }"),
        ("map/file.rs", "use super::Store; pub fn read() -> Store {}"),
    ];
    let found = cycles_of(&sources);
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].nodes, ["map/file.rs", "map/store.rs"]);
    let text = found[0].to_string();
    assert!(text.contains("map/store.rs needs read of map/file.rs"), "{text}");
}

#[test]
fn folders_may_go_in_a_circle_where_files_do_not() {
    let sources = [
        ("lib.rs", "mod a; mod b;"),
        ("a/mod.rs", "pub mod high; pub mod low;"),
        ("a/high.rs", "use crate::b::B;"),
        ("a/low.rs", "pub struct Low;"),
        ("b.rs", "use crate::a::low; pub struct B(low::Low);"),
    ];
    let found = cycles_of(&sources);
    assert_eq!(found.len(), 1);
    assert_eq!(
        (found[0].folder.as_deref(), &found[0].nodes[..]),
        (Some("the crate"), &["a".into(), "b".into()][..])
    );
}

#[test]
fn a_file_that_needs_what_its_folder_defines_is_in_a_circle_with_it() {
    let sources = [
        ("lib.rs", "mod data;"),
        ("data/mod.rs", "mod tum; pub struct Options; pub fn open() { tum::read(&Options) }"),
        ("data/tum.rs", "use super::Options; pub fn read(_: &Options) {}"),
    ];
    assert_eq!(cycles_of(&sources)[0].nodes, ["data/mod.rs", "data/tum.rs"]);
}
