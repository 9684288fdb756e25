//! Dependencies between the files of a crate, and their cycles.

use super::files::Package;
use super::parsed::{Module, ModulePath, read_crate};
use crate::repository;
use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Files that depend on each other, so that none can be read, moved or tested alone.
pub type Circle = Vec<String>;

/// Maximum length of a chain of re-exports; a longer chain is a cycle.
const DEEPEST_IMPORT: usize = 16;

/// Cycles among the files of a package, each a sorted list of paths relative to its `src`.
///
/// A file depends on another if it uses something that is defined there. A re-export in `lib.rs` or `mod.rs` counts as a use of the file
/// with the definition; the re-export itself and the declaration of a module are not uses.
pub fn circles(package: &Package) -> Vec<Circle> {
    circles_below(&repository().join(&package.folder).join("src"), &package.roots)
}

/// As [`circles`], for sources with these root files.
pub fn circles_below(src: &Path, roots: &[PathBuf]) -> Vec<Circle> {
    let mut circles = Vec::new();
    for root in roots {
        let modules = read_crate(root);
        let mut files = DiGraphMap::<&Path, ()>::new();
        for (from, to) in edges(&modules) {
            files.add_edge(from, to, ());
        }
        for component in tarjan_scc(&files).into_iter().filter(|component| component.len() > 1) {
            let mut circle: Circle = component
                .into_iter()
                .map(|file| file.strip_prefix(src).unwrap().to_string_lossy().replace('\\', "/"))
                .collect();
            circle.sort();
            circles.push(circle);
        }
    }
    circles.sort();
    circles
}

/// All pairs of files in which the first uses a definition of the second.
fn edges(modules: &BTreeMap<ModulePath, Module>) -> Vec<(&Path, &Path)> {
    let mut edges = Vec::new();
    for (path, module) in modules {
        let imported = module.imports.iter().filter_map(|import| {
            let target = resolve(modules, path, &import.target, 0)?;
            // A re-export of a submodule.
            let is_below = target.len() > path.len() && target.starts_with(path);
            (!(import.is_public && is_below)).then_some(target)
        });
        let named = module.names.iter().filter_map(|names| resolve(modules, path, names, 0));
        for target in imported.chain(named) {
            let (from, to) = (module.file.as_path(), modules[&target].file.as_path());
            if from != to {
                edges.push((from, to));
            }
        }
    }
    edges
}

/// The module with the definition of a name; `None` for names of other crates.
fn resolve(
    modules: &BTreeMap<ModulePath, Module>,
    from: &ModulePath,
    names: &[String],
    depth: usize,
) -> Option<ModulePath> {
    let mut at = from.clone();
    let mut remaining = names;
    let mut is_here = false;
    while let Some((first, others)) = remaining.split_first() {
        match first.as_str() {
            "crate" => at = Vec::new(),
            "self" => {}
            "super" => {
                at.pop()?;
            }
            _ => break,
        }
        is_here = true;
        remaining = others;
    }
    let Some((first, others)) = remaining.split_first() else { return is_here.then_some(at) };
    let module = modules.get(&at)?;
    let inner = [at.clone(), vec![first.clone()]].concat();
    if modules.contains_key(&inner) {
        return match others {
            [] => Some(inner),
            _ => resolve(modules, &inner, &[&["self".to_owned()], others].concat(), depth),
        };
    }
    if module.items.contains(first) {
        return Some(at);
    }
    if depth == DEEPEST_IMPORT {
        return None;
    }
    // Without this condition, an external import of the same name would recurse endlessly: `use rand; rand::random()`.
    let named = module.imports.iter().filter(|import| import.alias.as_ref() == Some(first));
    for import in named.filter(|import| import.target.first() != Some(first) || import.target.len() > 1) {
        let target = [&import.target, others].concat();
        if let Some(found) = resolve(modules, &at, &target, depth + 1) {
            return Some(found);
        }
    }
    let mut globs = module.imports.iter().filter(|import| import.alias.is_none());
    globs.find_map(|glob| resolve(modules, &at, &[&glob.target[..], remaining].concat(), depth + 1))
}
