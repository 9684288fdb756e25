//! Python environments with only the packages of one list: that of the tests, and that of the tools that build a release.

use crate::error::Error;
use crate::step::{self, command, run, say};
use crate::{files, workspace};
use std::fs;
use std::path::{Path, PathBuf};

/// Minimum version of Python for the pinned numpy and scipy.
const OLDEST: (&str, &str) = ("3.11", "(3, 11)");

/// The Python of the tests, whether it has been made or not.
pub fn python() -> PathBuf {
    home().join("bin/python")
}

fn home() -> PathBuf {
    workspace::target_dir().join("python-env")
}

/// The environment of the tests; returns its Python.
pub fn prepare() -> Result<PathBuf, Error> {
    prepare_in(&home(), "tests/python/requirements.txt")
}

/// Creates an environment with the packages of a list, unless it exists. Returns its Python.
pub fn prepare_in(home: &Path, list: &str) -> Result<PathBuf, Error> {
    let wanted = files::read(&workspace::root().join(list))?;
    let python = home.join("bin/python");
    // Written last, because its absence marks an incomplete environment.
    let stamp = home.join("made-from.txt");
    let made_from = fs::read_to_string(&stamp).unwrap_or_default();
    if made_from == wanted && step::succeeds(&python.to_string_lossy(), &["-m", "pip", "--version"]) {
        say(&format!("{} is up to date\n", home.display()));
        return Ok(python);
    }
    check_version()?;
    files::remove(home)?;
    run(command("python3", &["-m", "venv", &home.to_string_lossy()]))?;
    // Only wheels, because building scipy from source needs a Fortran compiler and half an hour.
    let arguments = ["-m", "pip", "install", "--disable-pip-version-check", "--no-input", "--quiet"];
    let packages = ["--only-binary", ":all:", "--requirement", list];
    run(command(&python, &[&arguments[..], &packages].concat()))?;
    files::write(&stamp, wanted)?;
    Ok(python)
}

fn check_version() -> Result<(), Error> {
    let script = format!("import sys; print(sys.version.split()[0], sys.version_info[:2] >= {})", OLDEST.1);
    let answer = step::output(command("python3", &["-c", &script]))?;
    match answer.split_once(' ') {
        Some((_, "True")) => Ok(()),
        _ => Err(Error::OldPython { found: answer, needed: OLDEST.0 }),
    }
}
