//! Rules of the source tree that the compiler does not know.

use std::path::{Path, PathBuf};

/// A word, and where it may be written.
struct Rule {
    /// In two parts, so that this file does not hold it.
    word: (&'static str, &'static str),
    places: &'static [&'static str],
    why: &'static str,
}

const RULES: &[Rule] = &[
    Rule {
        word: ("read_", "truth"),
        places: &["crates/recording/"],
        why: "what only a simulator knows is read by scoring alone",
    },
    Rule {
        word: ("recording::", "score"),
        places: &["crates/recording/", "crates/report/", "crates/session/"],
        why: "whatever identifies, corrects or diagnoses never sees what only a simulator knows",
    },
    Rule {
        word: ("saphyr_", "parser"),
        places: &["crates/yaml/src/document/positions.rs"],
        why: "YAML is read in one way, with positions, so that mistakes have places",
    },
];

fn rust_files(directory: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') {
                rust_files(&path, found);
            }
        } else if name.ends_with(".rs") {
            found.push(path);
        }
    }
}

#[test]
fn each_output_is_written_in_one_place() {
    let root = mapper_tests::repository();
    let mut files = Vec::new();
    for folder in ["crates", "plugins", "tests", "xtask", "examples"] {
        let folder = root.join(folder);
        if folder.is_dir() {
            rust_files(&folder, &mut files);
        }
    }
    assert!(files.len() > 50, "only {} files were found", files.len());
    let mut wrong = Vec::new();
    let mut seen = vec![0; RULES.len()];
    for file in &files {
        let text = std::fs::read_to_string(file).unwrap();
        let place = file.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        for (rule, seen) in RULES.iter().zip(&mut seen) {
            let word = format!("{}{}", rule.word.0, rule.word.1);
            let Some(line) = text.lines().position(|line| line.contains(&word)) else { continue };
            *seen += 1;
            if !rule.places.iter().any(|allowed| place.starts_with(allowed)) {
                wrong.push(format!("{place}:{}: `{word}`: {}", line + 1, rule.why));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    // A rule about a word that is not in use any more would hold for ever.
    assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
}

/// Where files that this program makes, and the kernel's own, are opened directly.
const OPENED_DIRECTLY: &[&str] = &[
    "crates/yaml/src/document/file.rs",
    // A page and its log in a temporary directory; the recording that was just created.
    "crates/session/src/analysis/pdf.rs",
    "crates/session/src/run/prepared_run.rs",
];

/// A pipe, a device or a file of the kernel may hang or have no end, so that one function opens files.
#[test]
fn files_are_opened_in_one_place() {
    let root = mapper_tests::repository();
    let mut files = Vec::new();
    ["crates", "plugins", "python"].iter().for_each(|folder| rust_files(&root.join(folder), &mut files));
    let mut wrong = Vec::new();
    let mut seen = 0;
    for file in &files {
        let place = file.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        if !place.contains("/src/") {
            continue;
        }
        let text = std::fs::read_to_string(file).unwrap();
        let production = text.split("#[cfg(test)]\nmod tests").next().unwrap();
        let opens = |line: &str| {
            ["File::open(", "fs::read(", "fs::read_to_string("].iter().any(|call| line.contains(call))
        };
        for (at, line) in production.lines().enumerate().filter(|(_, line)| opens(line)) {
            let line_is_allowed = line.contains("\"/proc/") || line.contains("CompoundFile::open(");
            seen += 1;
            if !line_is_allowed && !OPENED_DIRECTLY.contains(&place.as_str()) {
                wrong.push(format!("{place}:{}: use mapper_yaml::open_file or read_limited", at + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(seen >= OPENED_DIRECTLY.len(), "{seen}");
}
