//! Files small enough to be read in one go.

use mapper_tests::repository;
use mapper_tests::tree::{packages, production_lines};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Half of all files have at most so many lines before their tests.
const MEDIAN_LINES: usize = 120;
/// No file has more, unless its first comment says why.
const LONGEST_LINES: usize = 500;
/// All of the program's own crate, tests included: what decides anything lies below it.
const CLI_LINES: usize = 5_000;
/// Files that are longer without saying why: to be emptied.
const KNOWN: &[&str] = &[];

/// Entries of a folder of sources, its own `mod.rs`, `lib.rs` or `main.rs` not counted: as many as a reader keeps in view.
const FOLDER_ENTRIES: usize = 12;
/// Folders with one file per thing.
const ONE_FILE_PER_THING: &[&str] = &[
    "crates/cli/src/commands",
    "plugins/backends/src",
    "plugins/effects/src",
    "plugins/formats/src",
    "plugins/logs/src",
];

/// The word by which a first comment says why a file is as long as it is.
const REASON: &str = "One file because";

#[test]
fn production_files_are_small() {
    let mut lengths = Vec::new();
    for file in packages().into_iter().flat_map(|package| package.files) {
        let text = std::fs::read_to_string(&file).unwrap();
        let place = file.strip_prefix(repository()).unwrap().to_string_lossy().replace('\\', "/");
        let head: Vec<&str> = text.lines().take_while(|line| line.starts_with("//!")).collect();
        lengths.push((production_lines(&text), place, head.join(" ").contains(REASON)));
    }
    lengths.sort();
    let too_long: Vec<_> = lengths
        .iter()
        .filter(|(lines, place, has_reason)| {
            *lines > LONGEST_LINES && !has_reason && !KNOWN.contains(&place.as_str())
        })
        .map(|(lines, place, _)| format!("{place}: {lines}"))
        .collect();
    assert!(
        too_long.is_empty(),
        "files of more than {LONGEST_LINES} lines; split them, or start a sentence of the first comment with \
         `{REASON}`:\n{}",
        too_long.join("\n")
    );
    for known in KNOWN {
        let short = lengths.iter().any(|(lines, place, _)| place == known && *lines <= LONGEST_LINES);
        assert!(!short, "{known} is short enough now: take it off the list in {}", file!());
    }
    let (median, place, _) = &lengths[lengths.len() / 2];
    assert!(*median <= MEDIAN_LINES, "the median file, {place}, has {median} lines");
}

#[test]
fn the_command_line_crate_stays_small() {
    let cli = packages().into_iter().find(|package| package.folder == "crates/cli").unwrap();
    let lines: usize =
        cli.files.iter().map(|file| std::fs::read_to_string(file).unwrap().lines().count()).sum();
    assert!(lines <= CLI_LINES, "crates/cli has {lines} lines; what decides belongs into crates/session");
}

#[test]
fn folders_of_sources_are_small() {
    let mut entries: BTreeMap<PathBuf, BTreeSet<PathBuf>> = BTreeMap::new();
    for file in packages().into_iter().flat_map(|package| package.files) {
        let inside = file.strip_prefix(repository()).unwrap().to_owned();
        for below in inside.ancestors().filter(|path| path.components().any(|part| part.as_os_str() == "src"))
        {
            let module = below.with_extension("");
            let stem = module.file_name().unwrap().to_string_lossy().into_owned();
            if !["src", "mod", "lib", "main"].contains(&stem.as_str()) {
                entries.entry(below.parent().unwrap().to_owned()).or_default().insert(module);
            }
        }
    }
    assert!(entries.len() > 100, "only {} folders were found", entries.len());
    let too_full: Vec<_> = entries
        .iter()
        .filter(|(folder, modules)| {
            let one_per_thing = ONE_FILE_PER_THING.iter().any(|name| folder.ends_with(name));
            modules.len() > FOLDER_ENTRIES && !one_per_thing
        })
        .map(|(folder, modules)| format!("{}: {}", folder.display(), modules.len()))
        .collect();
    assert!(too_full.is_empty(), "folders of more than {FOLDER_ENTRIES} modules:\n{}", too_full.join("\n"));
}
