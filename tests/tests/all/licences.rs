//! What may be in the tree of dependencies, by licence: the list of deny.toml, checked here without cargo-deny and without a network. And what is
//! not in the program itself.

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, PackageId};
use std::collections::BTreeSet;

/// With all features, or with the default features of a build.
fn metadata(all_features: bool) -> Metadata {
    let manifest = mapper_tests::repository().join("Cargo.toml");
    // Of this machine alone: what others need was never downloaded.
    let options = ["--locked", "--filter-platform", "host-tuple"]
        .into_iter()
        .chain(all_features.then_some("--all-features"));
    let options: Vec<String> = options.map(str::to_owned).collect();
    MetadataCommand::new().manifest_path(manifest).other_options(options).exec().unwrap()
}

/// The list of deny.toml: strings of `allow`.
fn allowed() -> BTreeSet<String> {
    let text = std::fs::read_to_string(mapper_tests::repository().join("deny.toml")).unwrap();
    let (_, list) = text.split_once("allow = [").unwrap();
    let (list, _) = list.split_once(']').unwrap();
    list.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Whether an SPDX expression can be kept with what is allowed: `OR` is a choice, `AND` is not, `/` is an old `OR`.
fn may_be_used(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let plain = expression.replace('/', " OR ");
    let mut rest: Vec<&str> = Vec::new();
    let spaced = plain.replace('(', " ( ").replace(')', " ) ");
    rest.extend(spaced.split_whitespace().rev());
    either(&mut rest, allowed) && rest.is_empty()
}

fn either(rest: &mut Vec<&str>, allowed: &BTreeSet<String>) -> bool {
    let mut may = both(rest, allowed);
    while rest.last() == Some(&"OR") {
        rest.pop();
        may |= both(rest, allowed);
    }
    may
}

fn both(rest: &mut Vec<&str>, allowed: &BTreeSet<String>) -> bool {
    let mut may = one(rest, allowed);
    while rest.last() == Some(&"AND") {
        rest.pop();
        may &= one(rest, allowed);
    }
    may
}

fn one(rest: &mut Vec<&str>, allowed: &BTreeSet<String>) -> bool {
    match rest.pop() {
        Some("(") => {
            let may = either(rest, allowed);
            rest.pop() == Some(")") && may
        }
        Some(name) if rest.last() == Some(&"WITH") => {
            rest.pop();
            let exception = rest.pop().unwrap_or_default();
            allowed.contains(&format!("{name} WITH {exception}"))
        }
        // `+`: this version or a later one, so this one.
        Some(name) => allowed.contains(name.strip_suffix('+').unwrap_or(name)),
        None => false,
    }
}

#[test]
fn every_dependency_has_a_licence_that_is_allowed() {
    let (metadata, allowed) = (metadata(true), allowed());
    let foreign: Vec<_> = metadata.packages.iter().filter(|package| package.source.is_some()).collect();
    assert!(foreign.len() > 300, "only {} packages were found", foreign.len());
    let wrong: Vec<String> = foreign
        .iter()
        .filter(|package| !package.license.as_deref().is_some_and(|licence| may_be_used(licence, &allowed)))
        .map(|package| format!("{} {}: {:?}", package.name, package.version, package.license))
        .collect();
    assert!(wrong.is_empty(), "\n{}\nThe list is in deny.toml.", wrong.join("\n"));
}

#[test]
fn licence_expressions_follow_spdx() {
    let allowed: BTreeSet<String> =
        ["MIT", "Zlib", "Apache-2.0 WITH LLVM-exception"].map(str::to_owned).into();
    for (expression, may) in [
        ("MIT", true),
        ("GPL-3.0-only", false),
        ("MIT/GPL-3.0-only", true),
        ("GPL-3.0-only OR MIT", true),
        ("GPL-3.0-only AND MIT", false),
        ("(MIT OR GPL-3.0-only) AND Zlib", true),
        ("(MIT AND GPL-3.0-only) OR (GPL-2.0-only)", false),
        ("Apache-2.0 WITH LLVM-exception", true),
        ("Apache-2.0", false),
        ("MIT MIT", false),
        ("MIT+", true),
        ("", false),
        ("((MIT", false),
    ] {
        assert_eq!(may_be_used(expression, &allowed), may, "{expression}");
    }
}

/// Packages that a program is built from, without those of its tests.
fn tree(metadata: &Metadata, root: &str) -> BTreeSet<PackageId> {
    let resolve = metadata.resolve.as_ref().unwrap();
    let first = metadata.packages.iter().find(|package| package.name.as_str() == root).unwrap();
    let (mut seen, mut next) = (BTreeSet::new(), vec![first.id.clone()]);
    while let Some(id) = next.pop() {
        if !seen.insert(id.clone()) {
            continue;
        }
        let node = resolve.nodes.iter().find(|node| node.id == id).unwrap();
        let built = node.deps.iter().filter(|dependency| {
            dependency.dep_kinds.iter().any(|kind| kind.kind != DependencyKind::Development)
        });
        next.extend(built.map(|dependency| dependency.pkg.clone()));
    }
    seen
}

/// The libraries of a driver's protocol are not in the program.
#[test]
fn drivers_add_no_dependencies_to_the_program() {
    let metadata = metadata(false);
    let program = tree(&metadata, "mapper-cli");
    assert!(program.len() > 100, "{}", program.len());
    let name_of = |id: &PackageId| {
        let package = metadata.packages.iter().find(|package| package.id == *id).unwrap();
        (package.name.to_string(), package.manifest_path.as_str().contains("/drivers/"))
    };
    for id in &program {
        let (name, is_driver) = name_of(id);
        let own_to_drivers =
            ["tokio-modbus", "async-opcua", "rsa", "openssl"].iter().any(|one| name.starts_with(one));
        assert!(!is_driver && !own_to_drivers, "{name} is built into mapper");
    }
    let opcua = tree(&metadata, "mapper-backend-opcua");
    let more = opcua.difference(&program).count();
    assert!(more > 50, "{more}: a driver of its own saves the program {more} packages");
}
