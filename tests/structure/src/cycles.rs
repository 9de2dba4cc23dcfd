//! Cycles between files, and between the modules of a folder.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use crate::components::{Graph, components};
use crate::tree::{CrateTree, Dependency, ModulePath};

/// A group of files, or of modules of one folder, each of which needs all others of the group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cycle {
    /// The crate.
    pub crate_name: String,
    /// The folder whose modules these are; `None` for a cycle between files.
    pub folder: Option<String>,
    /// The files or modules, in the order of names.
    pub nodes: Vec<String>,
    /// What needs what within the group: the two nodes, the two files and the item.
    pub edges: Vec<Edge>,
}

/// One dependency within a [`Cycle`].
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Edge {
    /// Nodes of the cycle.
    pub nodes: [String; 2],
    /// Files behind them.
    pub files: [String; 2],
    /// What the first needs of the second.
    pub item: String,
}

impl fmt::Display for Cycle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.folder {
            Some(folder) => write!(f, "{}, modules of {folder}: ", self.crate_name)?,
            None => write!(f, "{}, files: ", self.crate_name)?,
        }
        writeln!(f, "{}", self.nodes.join(", "))?;
        for Edge { nodes: [from, to], files: [file, other], item } in &self.edges {
            writeln!(f, "    {from} -> {to}: {file} needs {item} of {other}")?;
        }
        Ok(())
    }
}

/// All cycles of a crate: first those between files, then those between the modules of each folder.
///
/// A folder's own file (`mod.rs`, `lib.rs`) may need the modules in the folder, and they may need it as long as no file
/// needs itself that way; it is no node of the folder's graph. A cycle of a folder whose modules are all single files is
/// one between files, and is not told twice.
#[must_use]
pub fn cycles(tree: &CrateTree) -> Vec<Cycle> {
    let dependencies = tree.dependencies();
    let by_file = |d: &Dependency| Some([tree.file(&d.from).to_owned(), tree.file(&d.to).to_owned()]);
    let mut found = of_graph(tree, &dependencies, None, &by_file);
    let folders: BTreeSet<ModulePath> = dependencies.iter().flat_map(|d| above(&d.from)).collect();
    for folder in folders {
        let by_module = |d: &Dependency| {
            let child =
                |path: &ModulePath| path.strip_prefix(&folder[..]).and_then(|rest| rest.first().cloned());
            let nodes = [child(&d.from)?, child(&d.to)?];
            (nodes[0] != nodes[1]).then_some(nodes)
        };
        let name = if folder.is_empty() { "the crate".to_owned() } else { folder.join("/") };
        let of_modules = of_graph(tree, &dependencies, Some(name), &by_module);
        let has_folder = |cycle: &Cycle| cycle.nodes.iter().any(|node| tree.has_children(&folder, node));
        found.extend(of_modules.into_iter().filter(has_folder));
    }
    found
}

/// All modules that a module is in.
fn above(module: &ModulePath) -> impl Iterator<Item = ModulePath> + '_ {
    (0..module.len()).map(|depth| module[..depth].to_vec())
}

fn of_graph(
    tree: &CrateTree,
    dependencies: &[Dependency],
    folder: Option<String>,
    nodes_of: &dyn Fn(&Dependency) -> Option<[String; 2]>,
) -> Vec<Cycle> {
    let mut graph = Graph::new();
    let mut edges: BTreeMap<[String; 2], BTreeSet<Edge>> = BTreeMap::new();
    for dependency in dependencies {
        let Some(nodes) = nodes_of(dependency) else { continue };
        let files = [&dependency.from, &dependency.to].map(|module| tree.file(module).to_owned());
        graph.entry(nodes[0].clone()).or_default().push(nodes[1].clone());
        let edge = Edge { nodes: nodes.clone(), files, item: dependency.item.clone() };
        edges.entry(nodes).or_default().insert(edge);
    }
    let within = |component: &[String]| {
        let inside = edges.iter().filter(|(nodes, _)| nodes.iter().all(|node| component.contains(node)));
        inside.flat_map(|(_, edges)| edges.iter().cloned()).collect()
    };
    let cycle = |nodes: Vec<String>| Cycle {
        crate_name: tree.name().to_owned(),
        folder: folder.clone(),
        edges: within(&nodes),
        nodes,
    };
    components(&graph).into_iter().map(cycle).collect()
}
