//! Where things are.

use std::path::{Path, PathBuf};

/// Root of the repository.
pub fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_owned()
}

/// Where build products go, as Cargo decides it.
pub fn target_dir() -> PathBuf {
    match std::env::var_os("CARGO_TARGET_DIR") {
        Some(given) => root().join(given),
        None => root().join("target"),
    }
}

/// The cargo that started this process.
pub fn cargo() -> String {
    std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned())
}

/// Names of the libraries whose manifest does not say that their documentation has no examples to run.
pub fn libraries_with_doc_tests() -> Vec<String> {
    let folders = ["crates", "plugins", "drivers"].map(|folder| root().join(folder));
    let members = folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten().flatten();
    let name = |folder: PathBuf| {
        let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).ok()?;
        let tested = folder.join("src/lib.rs").is_file() && !manifest.contains("doctest = false");
        let name = manifest.lines().find_map(|line| line.strip_prefix("name = "))?;
        tested.then(|| name.trim_matches('"').to_owned())
    };
    let mut names: Vec<String> = members.filter_map(|member| name(member.path())).collect();
    names.sort();
    names
}
