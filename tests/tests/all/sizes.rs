//! Files small enough to be read in one go.

use mapper_tests::repository;
use mapper_tests::tree::{packages, production_lines};

/// Half of all files have at most so many lines before their tests.
const MEDIAN_LINES: usize = 120;
/// No file has more, unless its first comment says why.
const LONGEST_LINES: usize = 500;
/// All of the program's own crate, tests included: what decides anything lies below it.
/// Raised from 3000 for the eight commands of `mapper fleet` and for `mapper history fleet`, each options, one call and its words;
/// from 3700 for `mapper map fmu` and `mapper map correct`, from 3800 for `mapper map inspect`, conversion of efficiencies and `mapper init`,
/// from 4050 for the help by task and lines as wide as the terminal.
const CLI_LINES: usize = 4_800;
/// Files that are longer without saying why: to be emptied.
const KNOWN: &[&str] = &[];

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
fn the_program_holds_words_and_no_decisions() {
    let cli = packages().into_iter().find(|package| package.folder == "crates/cli").unwrap();
    let lines: usize =
        cli.files.iter().map(|file| std::fs::read_to_string(file).unwrap().lines().count()).sum();
    assert!(lines <= CLI_LINES, "crates/cli has {lines} lines; what decides belongs into crates/session");
}
