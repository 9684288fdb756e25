//! Formats or checks every Rust file, including those that `cargo fmt` does not find.

use crate::error::Error;
use crate::step::{command, run};
use crate::workspace;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders whose modules are declared by a macro (`backends!`, `formats!`, `effects!`, `subcommands!`): rustfmt does not look into it.
const DECLARED_BY_MACRO: &[&str] =
    &["plugins/backends/src", "plugins/formats/src", "plugins/effects/src", "crates/cli/src/commands"];

/// Whether files are written or compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Format them.
    Write,
    /// Fail if a file is not formatted.
    Check,
}

/// Formats or checks every Rust file of the workspace.
pub fn formatting(mode: Mode) -> Result<(), Error> {
    let check: &[&str] = if mode == Mode::Check { &["--check"] } else { &[] };
    run(command(workspace::cargo(), &[&["fmt", "--all"], check].concat()))?;
    let mut files = Vec::new();
    for folder in DECLARED_BY_MACRO {
        rust_files(&workspace::root().join(folder), &mut files)?;
    }
    let mut rustfmt = command("rustfmt", &["--edition", "2024"]);
    rustfmt.args(check).args(files);
    run(rustfmt)
}

fn rust_files(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), Error> {
    let at = |source| Error::File { path: folder.to_owned(), source };
    for entry in fs::read_dir(folder).map_err(at)? {
        let path = entry.map_err(at)?.path();
        if path.is_dir() {
            rust_files(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
    Ok(())
}
