//! Runs the Python scripts of tests/python, which share no code with this program.

use crate::repository;
use serde_json::Value;
use std::ffi::OsStr;
use std::process::Command;

/// Runs a script of tests/python with the Python that `cargo xtask test` has prepared; returns its JSON output.
///
/// # Panics
/// Panics without such a Python. Tests that call this are then marked as ignored, with the reason.
#[track_caller]
pub fn python<S: AsRef<OsStr>>(script: &str, arguments: impl IntoIterator<Item = S>) -> Value {
    let Some(python) = option_env!("MAPPER_TEST_PYTHON") else {
        panic!("needs Python packages: run `cargo xtask test`")
    };
    let output = Command::new(python)
        .arg(repository().join("tests/python").join(script))
        .args(arguments)
        // No bytecode is written next to the scripts.
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap_or_else(|error| panic!("{python}: {error}; run `cargo xtask test`"));
    assert!(output.status.success(), "{script}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("the script prints JSON")
}
