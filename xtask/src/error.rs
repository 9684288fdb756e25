//! Errors of the developer commands.

use std::path::PathBuf;

/// Why a developer command failed; [`Display`](std::fmt::Display) describes the variants.
#[derive(Debug)]
pub enum Error {
    Start { command: String, source: std::io::Error },
    Failed { command: String },
    Missing { what: &'static str, used_for: &'static str, install: String },
    OldPython { found: String, needed: &'static str },
    File { path: PathBuf, source: std::io::Error },
    Steps { failed: Vec<&'static str> },
    Warnings { count: usize },
    LeftOut { count: usize },
    Stale { differences: Vec<String> },
    Constants { violations: String },
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Error::Start { command, source } => write!(f, "failed to start `{command}`: {source}"),
            Error::Failed { command } => write!(f, "`{command}` failed"),
            Error::Missing { what, used_for, install } => {
                write!(f, "{what} is missing ({used_for}). Install it, then try again: {install}")
            }
            Error::OldPython { found, needed } => {
                write!(
                    f,
                    "python3 is {found}; the packages of tests/python/requirements.txt need {needed} or newer"
                )
            }
            Error::File { path, source } => write!(f, "failed to use {}: {source}", path.display()),
            Error::Steps { failed } => write!(f, "failed: {}", failed.join(", ")),
            Error::Warnings { count } => write!(f, "{count} warnings (shown while building)"),
            Error::LeftOut { count } => {
                write!(
                    f,
                    "{count} tests were left out; `cargo xtask test` must run all (look for `ignored` above)"
                )
            }
            Error::Constants { violations } => write!(f, "numbers without a source:\n{violations}"),
            Error::Stale { differences } => write!(
                f,
                "generated documents are out of date; run `cargo xtask docs` and look at what changed:\n  {}",
                differences.join("\n  ")
            ),
        }
    }
}

impl std::error::Error for Error {}
