//! `cargo run -p mba-structure -- CRATE...` prints the cycles of crates, each given by its folder; exit code 1 if there
//! is any.

use std::path::Path;
use std::process::ExitCode;

use mba_structure::{CrateTree, cycles};

fn main() -> ExitCode {
    let mut found = 0;
    for folder in std::env::args().skip(1) {
        let tree = match CrateTree::read(&folder, &Path::new(&folder).join("src")) {
            Ok(tree) => tree,
            Err(error) => {
                eprintln!("{folder}: {error}");
                return ExitCode::from(2);
            }
        };
        for cycle in cycles(&tree) {
            print!("{cycle}");
            found += 1;
        }
    }
    println!("{found} cycles");
    if found == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
