//! Who uses whom within a crate, and where that goes in a circle.
//!
//! A crate is read from its sources alone: [`CrateTree::read`] follows `mod name;` from `lib.rs`, collects the paths
//! that each file names, and resolves them through the re-exports of the crate to the file that defines the item. What
//! is compiled for tests only is left out, and so are paths into other crates.
//!
//! [`cycles`] then looks at two graphs: that of the files, and for every folder that of the modules in it.
//!
//! ```
//! use mba_structure::{CrateTree, cycles};
//!
//! let sources = [
//!     ("lib.rs", "mod map; mod camera;"),
//!     ("map.rs", "use crate::camera::Camera; pub struct Map;"),
//!     ("camera.rs", "use crate::map::Map; pub struct Camera;"),
//! ];
//! let tree = CrateTree::from_sources("toy", &sources);
//! let found = cycles(&tree);
//! assert_eq!(found[0].nodes, ["camera.rs", "map.rs"]);
//! ```
//!
//! It reads paths as they are written. A method that another file implements for a type is not seen, nor is what a macro
//! makes.

mod components;
mod cycles;
mod lexer;
mod paths;
mod public_types;
mod tree;

pub use cycles::{Cycle, cycles};
pub use public_types::public_types;
pub use tree::{CrateTree, Dependency};
