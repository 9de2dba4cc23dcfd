//! A crate as a tree of modules, with paths resolved to files.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;

use crate::paths::{Import, Mentions, mentions};
use crate::public_types::public_types;

/// Longest chain of re-exports that is followed; longer ones go in a circle.
const MOST_HOPS: usize = 32;

/// Path of a module from the root of its crate.
pub(crate) type ModulePath = Vec<String>;

/// One crate.
#[derive(Clone, Debug)]
pub struct CrateTree {
    name: String,
    modules: BTreeMap<ModulePath, Module>,
    public_types: BTreeSet<String>,
    lines: usize,
}

#[derive(Clone, Debug)]
struct Module {
    file: String,
    mentions: Mentions,
}

/// One file needs an item of another one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Dependency {
    /// Module that names the item.
    pub(crate) from: ModulePath,
    /// Module that defines it.
    pub(crate) to: ModulePath,
    /// The item.
    pub item: String,
}

/// Where a path leads.
enum Target {
    /// A module itself.
    Module(ModulePath),
    /// An item of a module, with its name.
    Item(ModulePath, String),
}

impl CrateTree {
    /// Reads the crate whose `lib.rs` or `main.rs` is in the folder `sources`.
    ///
    /// # Errors
    /// Those of reading files; a module without a file is [`io::ErrorKind::NotFound`].
    pub fn read(name: &str, sources: &Path) -> io::Result<Self> {
        let root = if sources.join("lib.rs").is_file() { "lib.rs" } else { "main.rs" };
        let mut tree = Self::without_modules(name);
        let read = |file: &str| std::fs::read_to_string(sources.join(file)).ok();
        tree.add(Vec::new(), root, &read)?;
        Ok(tree)
    }

    fn without_modules(name: &str) -> Self {
        Self { name: name.to_owned(), modules: BTreeMap::new(), public_types: BTreeSet::new(), lines: 0 }
    }

    /// Lines of all files, without the tests at their ends and without files of tests.
    #[must_use]
    pub fn lines(&self) -> usize {
        self.lines
    }

    /// Names of the public types of all files, see [`public_types`](crate::public_types).
    #[must_use]
    pub fn public_types(&self) -> &BTreeSet<String> {
        &self.public_types
    }

    /// The crate of such sources: file names relative to the folder of `lib.rs`, which is the first, and their texts.
    ///
    /// # Panics
    /// Where a module has no file.
    #[must_use]
    pub fn from_sources(name: &str, sources: &[(&str, &str)]) -> Self {
        let mut tree = Self::without_modules(name);
        let read =
            |file: &str| sources.iter().find(|(name, _)| *name == file).map(|(_, text)| (*text).to_owned());
        tree.add(Vec::new(), sources[0].0, &read).expect("every module has a file");
        tree
    }

    /// The name of the crate.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Adds a module and those below it.
    fn add(&mut self, path: ModulePath, file: &str, read: &dyn Fn(&str) -> Option<String>) -> io::Result<()> {
        let missing = || io::Error::new(io::ErrorKind::NotFound, format!("{}: no file {file}", self.name));
        let source = read(file).ok_or_else(missing)?;
        self.public_types.extend(public_types(&source));
        let product = source.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        self.lines += product.lines().count();
        let mentions = mentions(&source);
        let children = mentions.children.clone();
        self.modules.insert(path.clone(), Module { file: file.to_owned(), mentions });
        for child in children {
            let mut path = path.clone();
            path.push(child);
            let name = path.join("/");
            let folder = format!("{name}/mod.rs");
            let file = if read(&folder).is_some() { folder } else { format!("{name}.rs") };
            self.add(path, &file, read)?;
        }
        Ok(())
    }

    /// The file of a module.
    pub(crate) fn file(&self, module: &ModulePath) -> &str {
        &self.modules[module].file
    }

    /// Whether the module `name` of `folder` has modules of its own.
    pub(crate) fn has_children(&self, folder: &ModulePath, name: &str) -> bool {
        let module = self.child(folder, name).and_then(|path| self.modules.get(&path));
        module.is_some_and(|module| !module.mentions.children.is_empty())
    }

    /// Every use of an item of one file by another file.
    ///
    /// That a module re-exports what is below it is no use: others come through it to what they need.
    #[must_use]
    pub fn dependencies(&self) -> Vec<Dependency> {
        let mut found = BTreeSet::new();
        for (from, module) in &self.modules {
            let mut add = |target: Option<Target>, is_reexport: bool| {
                let Some(Target::Item(to, item)) = target else { return };
                if to != *from && !(is_reexport && to.starts_with(from)) {
                    found.insert(Dependency { from: from.clone(), to, item });
                }
            };
            for import in &module.mentions.imports {
                if import.name == "*" {
                    if let Some(Target::Module(to)) = self.resolve(from, &import.path, 0) {
                        add(Some(Target::Item(to, "*".to_owned())), import.is_reexport);
                    }
                } else {
                    add(self.resolve(from, &import.path, 0), import.is_reexport);
                }
            }
            for path in &module.mentions.paths {
                add(self.resolve(from, path, 0), false);
            }
        }
        found.into_iter().collect()
    }

    /// Where `path`, as `module` writes it, leads within this crate.
    fn resolve(&self, module: &ModulePath, path: &[String], hops: usize) -> Option<Target> {
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => self.descend(Vec::new(), rest, hops),
            "self" => self.descend(module.clone(), rest, hops),
            "super" => {
                let (_, parent) = module.split_last()?;
                // More than one `super` in a row goes on from there as `self` would.
                let parent = parent.to_vec();
                match rest.first().map(String::as_str) {
                    Some("super") => self.resolve(&parent, rest, hops),
                    _ => self.descend(parent, rest, hops),
                }
            }
            name if self.has_name(module, name) => self.descend(module.clone(), path, hops),
            _ => None,
        }
    }

    /// Whether `name` is a child or an import of `module`. Other names of a file are its own or those of other crates.
    fn has_name(&self, module: &ModulePath, name: &str) -> bool {
        self.child(module, name).is_some() || self.import(module, name).is_some()
    }

    fn descend(&self, at: ModulePath, path: &[String], hops: usize) -> Option<Target> {
        let Some((name, rest)) = path.split_first() else { return Some(Target::Module(at)) };
        if let Some(child) = self.child(&at, name) {
            return self.descend(child, rest, hops);
        }
        if let Some(import) = self.import(&at, name).filter(|_| hops < MOST_HOPS) {
            let mut whole = import.path.clone();
            whole.extend_from_slice(rest);
            return self.resolve(&at, &whole, hops + 1);
        }
        Some(Target::Item(at, name.clone()))
    }

    fn child(&self, module: &ModulePath, name: &str) -> Option<ModulePath> {
        let mut path = module.clone();
        path.push(name.to_owned());
        self.modules.contains_key(&path).then_some(path)
    }

    fn import(&self, module: &ModulePath, name: &str) -> Option<&Import> {
        self.modules.get(module)?.mentions.imports.iter().find(|import| import.name == name)
    }
}
