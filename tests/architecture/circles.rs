//! Finds circles of files inside a crate: files that use each other, directly or around a loop.
//!
//! Every source is parsed. A name in a `use` item or in a path that begins with `crate`, `self` or
//! `super` is followed, through re-exports, to the file that defines it, and becomes an arrow to
//! that file. A re-export (`pub use`) is no arrow of its own: it only hands names on. Test modules
//! do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::{self, Visit};
use syn::{Item, UseTree, Visibility};

/// A module path below the crate's root, such as `["fusion", "cells"]`.
type ModulePath = Vec<String>;

/// A path that a source names, as written: `["super", "cells", "Sample"]`.
type NamedPath = Vec<String>;

/// What one file holds.
struct Module {
    file: PathBuf,
    /// Local name → path, for every name that a `use` item brings into the module.
    imports: BTreeMap<String, NamedPath>,
    /// Paths whose modules are taken over whole (`use x::*`).
    globs: Vec<NamedPath>,
    /// Paths that the code of this file uses itself, without re-exports.
    used: Vec<NamedPath>,
}

/// Finds the circles of a crate; `root` is its `lib.rs` or `main.rs`. Each circle is a sorted list
/// of files.
pub(crate) fn circles(root: &Path) -> Vec<Vec<PathBuf>> {
    let mut modules = BTreeMap::new();
    let folder = root.parent().expect("a crate root lies in a folder");
    read(root, folder, Vec::new(), &mut modules);
    let arrows: BTreeMap<&ModulePath, BTreeSet<ModulePath>> =
        modules.iter().map(|(path, module)| (path, targets(&modules, path, module))).collect();
    let reach: BTreeMap<&ModulePath, BTreeSet<ModulePath>> =
        arrows.keys().map(|path| (*path, reachable(&arrows, path))).collect();
    let mut found: BTreeSet<Vec<PathBuf>> = BTreeSet::new();
    for (path, seen) in &reach {
        if seen.contains(*path) {
            let members = seen.iter().filter(|other| reach[*other].contains(*path));
            found.insert(members.map(|member| modules[member].file.clone()).collect());
        }
    }
    found.into_iter().collect()
}

/// Reads a source and the modules that it declares.
fn read(file: &Path, children: &Path, path: ModulePath, modules: &mut BTreeMap<ModulePath, Module>) {
    let text = fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let parsed = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut module = Module { file: file.to_owned(), imports: BTreeMap::new(), globs: Vec::new(), used: Vec::new() };
    for item in parsed.items.iter().filter(|item| !is_test(attributes(item))) {
        match item {
            Item::Use(item) => {
                let is_re_export = !matches!(item.vis, Visibility::Inherited);
                flatten(&item.tree, &mut Vec::new(), &mut |local, target| {
                    if !is_re_export {
                        module.used.push(target.clone());
                    }
                    match local {
                        Some(name) => drop(module.imports.insert(name, target)),
                        None => module.globs.push(target),
                    }
                });
            }
            Item::Mod(item) if item.content.is_none() => {
                let name = item.ident.to_string();
                let flat = children.join(format!("{name}.rs"));
                let file = if flat.is_file() { flat } else { children.join(&name).join("mod.rs") };
                let below = path.iter().cloned().chain([name.clone()]).collect();
                read(&file, &children.join(&name), below, modules);
            }
            _ => {}
        }
        let mut paths = Paths(Vec::new());
        paths.visit_item(item);
        module.used.extend(paths.0);
    }
    modules.insert(path, module);
}

/// The paths of several segments in code.
struct Paths(Vec<NamedPath>);

impl<'a> Visit<'a> for Paths {
    fn visit_item_use(&mut self, _: &'a syn::ItemUse) {}

    fn visit_path(&mut self, path: &'a syn::Path) {
        if path.segments.len() > 1 {
            self.0.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }
}

/// Calls `take` with the local name (`None` for a glob) and the path of every leaf of a `use` tree.
fn flatten(tree: &UseTree, prefix: &mut NamedPath, take: &mut impl FnMut(Option<String>, NamedPath)) {
    let with = |name: String, prefix: &NamedPath| prefix.iter().cloned().chain([name]).collect::<NamedPath>();
    match tree {
        UseTree::Path(part) => {
            prefix.push(part.ident.to_string());
            flatten(&part.tree, prefix, take);
            prefix.pop();
        }
        UseTree::Name(leaf) if leaf.ident == "self" => take(prefix.last().cloned(), prefix.clone()),
        UseTree::Name(leaf) => take(Some(leaf.ident.to_string()), with(leaf.ident.to_string(), prefix)),
        UseTree::Rename(leaf) => take(Some(leaf.rename.to_string()), with(leaf.ident.to_string(), prefix)),
        UseTree::Glob(_) => take(None, prefix.clone()),
        UseTree::Group(group) => group.items.iter().for_each(|tree| flatten(tree, prefix, take)),
    }
}

fn attributes(item: &Item) -> &[syn::Attribute] {
    match item {
        Item::Mod(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        _ => &[],
    }
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && matches!(&attribute.meta, syn::Meta::List(list) if list.tokens.to_string() == "test")
    })
}

/// The other files that a file uses.
fn targets(modules: &BTreeMap<ModulePath, Module>, path: &ModulePath, module: &Module) -> BTreeSet<ModulePath> {
    let found = module.used.iter().filter_map(|named| resolve(modules, path, named, 0));
    found.filter(|target| target != path).collect()
}

/// The module that defines what a path names in the module `at`; `None` for names of other crates.
fn resolve(
    modules: &BTreeMap<ModulePath, Module>,
    at: &ModulePath,
    named: &[String],
    depth: usize,
) -> Option<ModulePath> {
    if depth > 16 {
        return None;
    }
    let (first, rest) = named.split_first()?;
    let (mut here, mut rest) = match first.as_str() {
        "crate" => (Vec::new(), rest),
        "self" => (at.clone(), rest),
        "super" => (at[..at.len().checked_sub(1)?].to_vec(), rest),
        name => {
            let child: ModulePath = at.iter().cloned().chain([name.to_owned()]).collect();
            if !modules.contains_key(&child) {
                let import = modules[at].imports.get(name)?;
                if import.first() == Some(first) {
                    return None;
                }
                let whole: NamedPath = import.iter().chain(rest).cloned().collect();
                return resolve(modules, at, &whole, depth + 1);
            }
            (child, rest)
        }
    };
    while let Some((name, after)) = rest.split_first() {
        if name == "super" {
            here.pop()?;
        } else {
            let child: ModulePath = here.iter().cloned().chain([name.clone()]).collect();
            if modules.contains_key(&child) {
                here = child;
            } else if let Some(import) = modules[&here].imports.get(name) {
                let whole: NamedPath = import.iter().chain(after).cloned().collect();
                let followed = resolve(modules, &here, &whole, depth + 1);
                return followed.or(Some(here));
            } else {
                return Some(here);
            }
        }
        rest = after;
    }
    Some(here)
}

fn reachable(arrows: &BTreeMap<&ModulePath, BTreeSet<ModulePath>>, from: &ModulePath) -> BTreeSet<ModulePath> {
    let mut seen = BTreeSet::new();
    let mut open: Vec<&ModulePath> = arrows[from].iter().collect();
    while let Some(next) = open.pop() {
        if seen.insert(next.clone()) {
            open.extend(&arrows[next]);
        }
    }
    seen
}
