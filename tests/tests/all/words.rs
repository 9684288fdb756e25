//! Counts words that CONTRIBUTING.md forbids.

use mapper_tests::repository;
use std::path::Path;

/// The forbidden words; each is split, so that this list is not counted.
const HIDDEN: [(&str, &str); 12] = [
    ("to", "ld"),
    ("sa", "id"),
    ("besi", "de"),
    ("ane", "w"),
    ("mend", "ed"),
    ("nobo", "dy"),
    ("somebo", "dy"),
    ("anybo", "dy"),
    ("weig", "hed"),
    ("lac", "ks"),
    ("lac", "king"),
    ("forete", "ll"),
];

/// Limit per thousand lines: wire formats and generated texts contain some.
const IN_A_THOUSAND_LINES: usize = 2;

#[test]
fn words_are_plain() {
    let hidden: Vec<String> = HIDDEN.iter().map(|(start, end)| format!("{start}{end}")).collect();
    let (mut lines, mut found) = (0, Vec::new());
    for folder in ["crates", "plugins", "docs", "python", "tests", "xtask"] {
        count(&repository().join(folder), &hidden, &mut lines, &mut found);
    }
    assert!(lines > 50_000, "{lines} lines were read");
    assert!(
        1000 * found.len() <= IN_A_THOUSAND_LINES * lines,
        "{} in {lines} lines:\n{}",
        found.len(),
        found.join("\n")
    );
}

fn count(folder: &Path, hidden: &[String], lines: &mut usize, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if path.is_dir() {
            // Builds, and environments of Python.
            if !["target", "venv", "node_modules"].contains(&name.as_str()) && !name.starts_with('.') {
                count(&path, hidden, lines, found);
            }
            continue;
        }
        if ![".rs", ".md", ".py", ".yaml"].iter().any(|end| name.ends_with(end)) {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        for line in text.lines() {
            *lines += 1;
            let words = line.split(|letter: char| !letter.is_alphabetic()).map(str::to_lowercase);
            found.extend(
                words.filter(|word| hidden.contains(word)).map(|word| format!("{}: {word}", path.display())),
            );
        }
    }
}
