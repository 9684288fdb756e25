//! Dependencies between packages only point down the layers.

use cargo_metadata::{DependencyKind, MetadataCommand, Package};
use std::collections::BTreeMap;

/// What each package of this workspace may use of the others. A package that is not here fails the test: a new one
/// gets its row. The order is that of the layers, lowest first.
#[rustfmt::skip]
const ALLOWED: &[(&str, &[&str])] = &[
    ("mapper-yaml",      &[]),
    ("mapper-core",      &[]),
    ("mapper-chart",     &["core"]),
    ("mapper-numerics",  &[]),
    // Cells, names and units of logs and maps.
    ("mapper-table",     &["core", "yaml"]),
    // Work in many pieces, independent of its content.
    ("mapper-fleet",     &["numerics", "yaml"]),
    ("mapper-physics",   &["core", "numerics"]),
    ("mapper-fmu",       &["core", "physics"]),
    // Nominal maps of campaigns are tables of points, so maps lie below campaigns.
    ("mapper-maps",      &["core", "numerics", "physics", "table", "yaml"]),
    ("mapper-campaign",  &["core", "maps", "physics", "yaml"]),
    ("mapper-planner",   &["core", "numerics", "physics"]),
    ("mapper-sequence",  &["core", "numerics", "physics", "yaml"]),
    ("mapper-runner",    &["core", "numerics", "physics"]),
    ("mapper-driver-host", &["core"]),
    ("mapper-recording", &["core", "numerics", "table", "yaml"]),
    ("mapper-observe",   &["core", "numerics", "physics"]),
    ("mapper-inference", &["numerics"]),
    ("mapper-identify",  &["core", "inference", "numerics", "physics", "observe"]),
    ("mapper-diagnose",  &["core", "numerics", "physics", "observe", "inference", "identify"]),
    ("mapper-history",   &["core", "numerics", "yaml"]),
    // Plug-ins do not depend on each other.
    // A backend may read recordings: replay does.
    ("mapper-backends",  &["core", "numerics", "physics", "recording", "yaml"]),
    ("mapper-effects",   &["core", "physics"]),
    ("mapper-formats",   &["core", "yaml", "numerics", "physics", "chart", "maps"]),
    ("mapper-log-formats", &["recording", "table"]),
    // Text, pages and pictures, made from data.
    ("mapper-report",    &["core", "chart", "observe", "physics", "campaign", "planner", "identify", "numerics", "maps", "diagnose", "history", "recording", "fleet"]),
    // The application as a library. The caller passes the plug-ins.
    ("mapper-session",   &["core", "chart", "physics", "campaign", "planner", "runner", "sequence", "recording", "observe", "identify", "diagnose", "history", "maps", "report", "numerics", "fleet", "fmu", "yaml"]),
    // The front door: the application with every plug-in, as a library.
    ("mapper",           &["core", "physics", "campaign", "driver-host", "recording", "diagnose", "report", "session", "backends", "effects", "formats", "log-formats"]),
    // Pages that the program serves.
    ("mapper-live",      &["core", "campaign", "history", "recording", "report", "session", "yaml"]),
    // Blind cases on the virtual lab, calibrations, the figures of the paper; above the application, like the program.
    ("mapper-validation", &["core", "chart", "numerics", "physics", "campaign", "runner", "recording", "observe", "identify", "diagnose", "history", "report", "session", "backends", "effects", "fleet", "yaml"]),
    // No package depends on the program. It and the Python package have their plug-ins from the front door.
    ("mapper-cli",       &["mapper", "core", "physics", "campaign", "driver-host", "planner", "recording", "diagnose", "history", "maps", "report", "session", "live", "fleet", "validation"]),
    ("mapper-python",    &["mapper", "core", "recording", "maps", "session", "driver-host"]),
    // Drivers are separate programs: their common parts, and the libraries of each rig.
    ("mapper-driver",    &["core", "driver-host"]),
    ("mapper-backend-lab", &["core", "campaign", "session", "backends", "effects", "driver"]),
    // Common part of drivers for controllers.
    ("mapper-controller", &["core", "yaml", "driver"]),
    ("mapper-backend-ak", &["core", "yaml", "driver"]),
    ("mapper-backend-modbus", &["core", "yaml", "driver", "controller"]),
    ("mapper-backend-opcua", &["core", "yaml", "driver", "controller"]),
    // A simulated stand, with which drivers communicate; it shares the AK telegrams with the driver.
    ("mapper-lab-server", &["core", "campaign", "session", "backends", "effects", "backend-ak"]),
    // Tests run the program and read its files, and compare gases with Python's CoolProp, which is installed for them alone; maintenance
    // commands are independent of the program.
    ("mapper-tests",     &["core", "physics", "recording", "xtask"]),
    ("xtask",            &[]),
];

/// Tests may use more packages than the tested one, but packages that only need recordings are tested with recordings only.
const NEVER_IN_TESTS: &[(&str, &[&str])] = &[
    ("mapper-observe", &["mapper-backends", "mapper-effects", "mapper-cli"]),
    ("mapper-identify", &["mapper-backends", "mapper-effects", "mapper-cli"]),
    ("mapper-maps", &["mapper-backends", "mapper-effects", "mapper-cli"]),
    ("mapper-diagnose", &["mapper-backends", "mapper-validation", "mapper-cli"]),
];

/// Libraries that only some packages may use.
const RESTRICTED: &[(&str, &[&str], &str)] = &[
    (
        "saphyr-parser",
        &["mapper-yaml"],
        "YAML is read in one way, with positions, so that mistakes have places",
    ),
    (
        "serde_yaml",
        &["mapper-yaml", "mapper-session"],
        "mapper-yaml reads YAML, with places and limits; mapper-session only writes it",
    ),
];

/// One dependency, and whether only tests use it.
#[derive(Clone, Copy)]
struct Edge<'a> {
    from: &'a str,
    to: &'a str,
    in_tests_alone: bool,
}

/// The violated rule of a dependency; `None` if it is allowed.
fn complaint(edge: Edge<'_>) -> Option<String> {
    let Edge { from, to, in_tests_alone } = edge;
    if let Some((_, users, why)) = RESTRICTED.iter().find(|(name, ..)| *name == to) {
        let right = users.contains(&from);
        return (!right).then(|| format!("{from} -> {to}: only {} may use {to}: {why}", users.join(" and ")));
    }
    let row = |table: &'static [(&str, &'static [&'static str])]| {
        table.iter().find(|(name, _)| *name == from).map(|(_, others)| *others)
    };
    let own = |name: &str| name.starts_with("mapper-") || ["mapper", "xtask"].contains(&name);
    if !own(to) {
        return None;
    }
    if in_tests_alone && from != "mapper-tests" {
        let never = row(NEVER_IN_TESTS).unwrap_or_default();
        return never.contains(&to).then(|| {
            format!("{from} -> {to} (in tests): {from} works from recordings alone, its tests too; write test data without {to}")
        });
    }
    let short = to.strip_prefix("mapper-").unwrap_or(to);
    let allowed = row(ALLOWED)?;
    (!allowed.contains(&short)).then(|| {
        let list = if allowed.is_empty() { "no other package".to_owned() } else { allowed.join(", ") };
        format!("{from} -> {to}: dependencies point down only; {from} may use {list}")
    })
}

fn edges(packages: &[Package]) -> impl Iterator<Item = Edge<'_>> {
    packages.iter().flat_map(|package| {
        package.dependencies.iter().map(|dependency| Edge {
            from: &package.name,
            to: &dependency.name,
            in_tests_alone: dependency.kind == DependencyKind::Development,
        })
    })
}

fn workspace_packages() -> Vec<Package> {
    let manifest = mapper_tests::repository().join("Cargo.toml");
    // Without dependencies of dependencies: nothing has to be downloaded, and the rule is about direct edges.
    let metadata = MetadataCommand::new().manifest_path(manifest).no_deps().exec().unwrap();
    metadata.packages
}

#[test]
fn dependencies_point_down_only() {
    let packages = workspace_packages();
    let wrong: Vec<String> = edges(&packages).filter_map(complaint).collect();
    assert!(wrong.is_empty(), "\n{}\nThe table is in {}.", wrong.join("\n"), file!());
}

#[test]
fn every_package_is_in_the_table() {
    let packages = workspace_packages();
    assert!(packages.len() > 10, "only {} packages were found", packages.len());
    for package in &packages {
        let rows = ALLOWED.iter().filter(|(name, _)| *name == package.name.as_str()).count();
        assert_eq!(rows, 1, "{} needs one row in the table of {}", package.name, file!());
    }
}

#[test]
fn the_table_has_no_circular_dependencies() {
    let allowed: BTreeMap<&str, &[&str]> = ALLOWED
        .iter()
        .map(|(name, others)| (name.strip_prefix("mapper-").unwrap_or(name), *others))
        .collect();
    let mut done: Vec<&str> = Vec::new();
    // Packages whose own packages are all done, until none is left.
    while done.len() < allowed.len() {
        let next = allowed
            .iter()
            .find(|(name, others)| !done.contains(name) && others.iter().all(|other| done.contains(other)))
            .map(|(name, _)| *name);
        done.push(next.expect("a circle, or a name without a row"));
    }
}

#[test]
fn forbidden_dependencies_are_reported() {
    let edge = |from, to, in_tests_alone| complaint(Edge { from, to, in_tests_alone });
    let upward = edge("mapper-core", "mapper-physics", false).unwrap();
    assert!(upward.contains("mapper-core -> mapper-physics") && upward.contains("point down"), "{upward}");
    for (from, to) in [
        ("mapper-identify", "mapper-backends"),
        ("mapper-runner", "mapper-cli"),
        ("mapper-formats", "mapper-backends"),
        ("mapper-physics", "saphyr-parser"),
        ("mapper-tests", "mapper-cli"),
    ] {
        assert!(edge(from, to, false).is_some(), "{from} -> {to}");
    }
    assert!(edge("mapper-identify", "mapper-backends", true).is_some());
    assert!(edge("mapper-tests", "mapper-identify", true).is_some());
    assert!(edge("mapper-runner", "mapper-backends", true).is_none());
    assert!(edge("mapper-core", "serde", false).is_none());
}
