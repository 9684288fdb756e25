//! No circular dependencies inside a crate or between crates: a lower module can be read, moved and tested without the upper ones.

use cargo_metadata::{DependencyKind, MetadataCommand};
use mapper_tests::tree::{circles, packages};
use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;
use std::collections::BTreeMap;

/// Circles that are known and to be broken: folder of the package, and its files from `src`. What is left of one may stay;
/// one that is gone fails the test as well, so that this list can only shrink.
#[rustfmt::skip]
const KNOWN: &[(&str, &[&str])] = &[];

#[test]
fn modules_of_a_crate_have_no_circular_dependencies() {
    let packages = packages();
    assert!(packages.len() > 15, "only {} packages were found", packages.len());
    let mut found = Vec::new();
    for package in &packages {
        found.extend(circles(package).into_iter().map(|circle| (package.folder.clone(), circle)));
    }
    let is_part_of =
        |circle: &[String], files: &[&str]| circle.iter().all(|file| files.contains(&file.as_str()));
    let is_known = |folder: &str, circle: &[String]| {
        KNOWN.iter().any(|(known, files)| *known == folder && is_part_of(circle, files))
    };
    let new: Vec<String> = found
        .iter()
        .filter(|(folder, circle)| !is_known(folder, circle))
        .map(|(folder, circle)| format!("(\"{folder}\", &{circle:?}),"))
        .collect();
    assert!(
        new.is_empty(),
        "files that need each other; give what they share a file of its own:\n{}",
        new.join("\n")
    );
    for (folder, files) in KNOWN {
        let there = found.iter().any(|(found, circle)| found == folder && is_part_of(circle, files));
        assert!(there, "{folder}: the circle of {files:?} is gone: take it off the list in {}", file!());
    }
}

/// The modules of the Python package, imports for type checkers included.
#[test]
fn modules_of_the_python_package_have_no_circular_imports() {
    let folder = mapper_tests::repository().join("python/python/mapper");
    let mut sources = BTreeMap::new();
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.extension().is_some_and(|end| end == "py") {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            sources.insert(name, std::fs::read_to_string(&path).unwrap());
        }
    }
    let mut imports = DiGraphMap::<&str, ()>::new();
    for (name, text) in &sources {
        for line in text.lines().map(str::trim_start) {
            // `from mapper._map import Map`, or `from mapper import _map, _tables`.
            let Some(rest) = line.strip_prefix("from mapper") else { continue };
            let (module, names) = rest.split_once(" import ").unwrap();
            let imported = if module.is_empty() { names } else { &module[1..] };
            for other in imported.split(", ").filter_map(|other| sources.get_key_value(other)) {
                imports.add_edge(name, other.0, ());
            }
        }
    }
    assert!(imports.edge_count() > 20, "{} imports were found", imports.edge_count());
    let circles: Vec<_> = tarjan_scc(&imports).into_iter().filter(|circle| circle.len() > 1).collect();
    assert!(circles.is_empty(), "{circles:?}");
}

/// Dependencies of tests count too, which Cargo itself does not check.
#[test]
fn crates_have_no_circular_dependencies() {
    let manifest = mapper_tests::repository().join("Cargo.toml");
    let metadata = MetadataCommand::new().manifest_path(manifest).no_deps().exec().unwrap();
    let mut packages = DiGraphMap::<&str, ()>::new();
    for package in &metadata.packages {
        for dependency in &package.dependencies {
            let is_own = metadata.packages.iter().any(|other| *other.name == dependency.name);
            if is_own && dependency.kind != DependencyKind::Build {
                packages.add_edge(package.name.as_str(), dependency.name.as_str(), ());
            }
        }
    }
    let circles: Vec<_> = tarjan_scc(&packages).into_iter().filter(|circle| circle.len() > 1).collect();
    assert!(circles.is_empty(), "{circles:?}");
}

/// Violations by `use`, by path, through a re-export and in a macro are detected; those in tests are ignored.
#[test]
fn circular_dependencies_are_detected() {
    let directory = mapper_tests::scratch();
    let files = [
        ("lib.rs", "mod a; mod b; mod c; mod d; mod e; mod f; pub use a::A; use f::F; pub struct Root(F);"),
        ("a.rs", "use crate::b::B; pub struct A(B);"),
        ("b.rs", "pub struct B; fn f() { let _ = std::mem::size_of::<Option<crate::A>>(); }"),
        ("c.rs", "pub struct C; fn f() { println!(\"{}\", super::d::D); }"),
        ("d.rs", "pub const D: u8 = { fn g() { use crate::c::C as Other; } 1 };"),
        ("e.rs", "pub struct E; #[cfg(test)] mod tests { use crate::f::F; }"),
        ("f.rs", "use super::e::*; pub struct F(E);"),
    ];
    for (name, text) in files {
        std::fs::write(directory.path().join(name), text).unwrap();
    }
    let found = mapper_tests::tree::circles_below(directory.path(), &[directory.path().join("lib.rs")]);
    assert_eq!(found, [["a.rs", "b.rs"], ["c.rs", "d.rs"]]);
}
