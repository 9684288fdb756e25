//! Formats or checks every Rust file, including those that `cargo fmt` does not find.

use crate::error::Error;
use crate::files::{Mode, rust_files};
use crate::step::{command, run};
use crate::workspace;

/// Folders whose modules are declared by a macro (`backends!`, `formats!`, `effects!`, `subcommands!`): rustfmt does not look into it.
const DECLARED_BY_MACRO: &[&str] =
    &["plugins/backends/src", "plugins/formats/src", "plugins/effects/src", "crates/cli/src/commands"];

/// Formats or checks every Rust file of the workspace.
pub fn formatting(mode: Mode) -> Result<(), Error> {
    let check: &[&str] = if mode == Mode::Check { &["--check"] } else { &[] };
    run(command(workspace::cargo(), &[&["fmt", "--all"], check].concat()))?;
    let mut files = Vec::new();
    for folder in DECLARED_BY_MACRO {
        files.extend(rust_files(&workspace::root().join(folder))?);
    }
    let mut rustfmt = command("rustfmt", &["--edition", "2024"]);
    rustfmt.args(check).args(files);
    run(rustfmt)
}
