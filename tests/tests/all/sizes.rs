//! Files and folders of a size that a reader takes in: one concept a file, and no more code than the program needs.

use mapper_tests::repository;
use mapper_tests::tree::{packages, production_lines};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// No file has more lines before its tests: an hour's reading.
const LONGEST_LINES: usize = 600;
/// A file of fewer lines holds a part of a concept.
const SHORT_LINES: usize = 60;
/// Maximum share of short files; it may only fall, to a tenth.
const MAX_SHORT_SHARE: f64 = 0.11;
/// Maximum number of production files; it may only fall, to 650.
const MAX_FILES: usize = 708;
/// Maximum number of production lines; it may only fall, to 118 000, which a few engineers can own.
const MAX_LINES: usize = 141_000;
/// All of the program's own crate, tests included: what decides anything lies below it.
const CLI_LINES: usize = 5_000;

/// Entries of a folder of sources, its own `mod.rs`, `lib.rs` or `main.rs` not counted: as many as a reader keeps in view.
const FOLDER_ENTRIES: usize = 18;
/// Folders with one file per thing.
const ONE_FILE_PER_THING: &[&str] = &[
    "crates/cli/src/commands",
    "plugins/backends/src",
    "plugins/effects/src",
    "plugins/formats/src",
    "plugins/logs/src",
];

/// Files whose name says that they are a list of what stands beside them.
fn is_list(place: &str) -> bool {
    ["/mod.rs", "/lib.rs", "/main.rs"].iter().any(|name| place.ends_with(name))
}

/// Production lines of every file, by its path from the root of the repository.
fn lengths() -> BTreeMap<String, usize> {
    let files = packages().into_iter().flat_map(|package| package.files);
    files
        .map(|file| {
            let text = std::fs::read_to_string(&file).unwrap();
            let place = file.strip_prefix(repository()).unwrap().to_string_lossy().replace('\\', "/");
            (place, production_lines(&text))
        })
        .collect()
}

/// The counts are printed: `cargo xtask test` shows them.
#[allow(clippy::print_stdout, reason = "the counts are stated in every run of the tests")]
#[test]
fn the_tree_is_small_enough_to_own() {
    let lengths = lengths();
    let mut of_package = BTreeMap::<String, usize>::new();
    for (place, lines) in &lengths {
        let package = place.split("/src/").next().unwrap_or(place);
        *of_package.entry(package.to_owned()).or_default() += lines;
    }
    for (package, lines) in &of_package {
        println!("{lines:7} {package}");
    }
    let total: usize = lengths.values().sum();
    println!("{total:7} production lines in {} files", lengths.len());
    assert!(
        total <= MAX_LINES,
        "{total} production lines, at most {MAX_LINES}: remove what nobody would miss"
    );
    assert!(
        lengths.len() <= MAX_FILES,
        "{} files, at most {MAX_FILES}: a file holds a concept",
        lengths.len()
    );
}

#[test]
fn a_file_holds_one_concept() {
    let lengths = lengths();
    let too_long: Vec<_> = lengths.iter().filter(|(_, lines)| **lines > LONGEST_LINES).collect();
    assert!(too_long.is_empty(), "files of more than {LONGEST_LINES} lines, to be split: {too_long:?}");
    let files: Vec<_> = lengths.iter().filter(|(place, _)| !is_list(place)).collect();
    let short: Vec<_> = files.iter().filter(|(_, lines)| **lines < SHORT_LINES).collect();
    assert!(
        short.len() as f64 <= MAX_SHORT_SHARE * files.len() as f64,
        "{} of {} files have fewer than {SHORT_LINES} lines; merge those that hold a part of a concept:\n{short:?}",
        short.len(),
        files.len()
    );
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
