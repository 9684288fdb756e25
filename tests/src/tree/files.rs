//! Packages of this workspace and their Rust files.

use crate::repository;
use std::path::{Path, PathBuf};

/// A package of this workspace.
#[derive(Debug, Clone)]
pub struct Package {
    /// Its folder, from the root of the repository: `crates/core`.
    pub folder: String,
    /// Roots of its library and of its programs, as far as they exist.
    pub roots: Vec<PathBuf>,
    /// All Rust files below its `src`, sorted.
    pub files: Vec<PathBuf>,
}

/// All packages in `crates`, `plugins` and `plugins/drivers`, by folder, sorted.
pub fn packages() -> Vec<Package> {
    let mut packages = Vec::new();
    for group in ["crates", "plugins", "plugins/drivers"] {
        for folder in sorted(&repository().join(group)) {
            let src = folder.join("src");
            if !folder.join("Cargo.toml").is_file() {
                continue;
            }
            let roots = ["lib.rs", "main.rs"].map(|name| src.join(name)).into_iter();
            let mut files = Vec::new();
            rust_files(&src, &mut files);
            packages.push(Package {
                folder: format!("{group}/{}", folder.file_name().unwrap().to_string_lossy()),
                roots: roots.filter(|root| root.is_file()).collect(),
                files,
            });
        }
    }
    packages
}

/// Lines of a file before its tests.
pub fn production_lines(text: &str) -> usize {
    let lines: Vec<&str> = text.lines().collect();
    let tests =
        lines.windows(2).position(|pair| pair[0] == "#[cfg(test)]" && pair[1].starts_with("mod tests"));
    tests.unwrap_or(lines.len())
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in sorted(folder) {
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

fn sorted(folder: &Path) -> Vec<PathBuf> {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    entries.sort();
    entries
}
