//! Lints and documentation.

use crate::step::command;
use crate::workspace;
use std::path::Path;
use std::process::Command;

/// Clippy on every target of the workspace, with warnings denied.
pub fn lints(features: &[&str]) -> Command {
    let head = ["clippy", "--workspace", "--all-targets", "--quiet"];
    command(workspace::cargo(), &[&head[..], features, &["--", "-D", "warnings"]].concat())
}

/// The documentation of the members of the workspace, with warnings denied.
///
/// Uses the environment variables that `cargo clippy` sets, so that Cargo reuses its results. If a release of clippy uses other variables,
/// the members are only checked again.
pub fn documentation() -> Command {
    let head = ["doc", "--no-deps", "--workspace", "--all-features", "--quiet"];
    let mut documentation = command(workspace::cargo(), &head);
    documentation
        .env("RUSTDOCFLAGS", "-D warnings")
        .env("RUSTC_WORKSPACE_WRAPPER", Path::new(&workspace::cargo()).with_file_name("clippy-driver"))
        .env("CLIPPY_ARGS", "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__");
    documentation
}
