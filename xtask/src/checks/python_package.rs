//! The Python package: its tests on the library that was built with everything else, and releases.

use crate::environment::capabilities::{Capabilities, with_program};
use crate::error::Error;
use crate::files::{self, at};
use crate::step::{command, run};
use crate::{environment::python_env, workspace};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Checks types, style, tests and notebooks of the package, assembled from its Python files and the debug build. The wheel differs only in
/// optimisation, and building it would double the time.
pub fn check(capabilities: &Capabilities) -> Result<(), Error> {
    let home = workspace::target_dir().join("python-package");
    let package = home.join("mapper");
    files::remove(&package)?;
    copy_files(&workspace::root().join("python/python/mapper"), &package)?;
    let library = workspace::target_dir().join("debug/lib_mapper.so");
    copy(&library, &package.join("_mapper.abi3.so"))?;
    let python_command = |arguments: &[&str]| {
        let mut command = with_program(command(&capabilities.python, arguments));
        command.env("PYTHONPATH", &home).env("MPLBACKEND", "agg");
        command
    };
    let tests = || {
        run(command(&capabilities.python, &["python/release.py", "source"]))?;
        run(python_command(&["-m", "ruff", "check", "python"]))?;
        run(python_command(&["-m", "mypy"]))?;
        run(python_command(&["-m", "pytest", "--quiet", "-p", "no:cacheprovider"]))
    };
    // Run in parallel, because each uses only one processor.
    let (tested, executed) = std::thread::scope(|scope| {
        let tests = scope.spawn(tests);
        let executed = execute_notebooks(&python_command);
        (tests.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), executed)
    });
    tested.and(executed)
}

/// Runs every notebook in its directory; they write into temporary ones.
fn execute_notebooks(python_command: &dyn Fn(&[&str]) -> Command) -> Result<(), Error> {
    let script = "import nbformat, nbclient, sys\n\
                  book = nbformat.read(sys.argv[1], as_version=4)\n\
                  nbclient.NotebookClient(book, timeout=600, kernel_name='python3').execute()";
    let notebooks = workspace::root().join("examples/notebooks");
    for notebook in plain_files(&notebooks)? {
        let mut execute = python_command(&["-c", script, &notebook.to_string_lossy()]);
        execute.current_dir(&notebooks);
        run(execute)?;
    }
    Ok(())
}

/// Builds what is installed without Rust, and uses it: python/release.py with the tools of its list.
pub fn release(arguments: &[&str]) -> Result<(), Error> {
    let home = workspace::target_dir().join("release-env");
    let python = python_env::prepare_in(&home, "python/release-tools.txt")?;
    run(command(python, &[&["python/release.py"], arguments].concat()))
}

fn copy_files(from: &Path, to: &Path) -> Result<(), Error> {
    fs::create_dir_all(to).map_err(at(to))?;
    for file in plain_files(from)? {
        let name = file.file_name().unwrap_or_default();
        // A library from a development build of the package.
        if file.extension().is_none_or(|extension| extension != "so") {
            copy(&file, &to.join(name))?;
        }
    }
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<(), Error> {
    fs::copy(from, to).map(drop).map_err(at(from))
}

/// The plain files of a directory.
fn plain_files(directory: &Path) -> Result<Vec<PathBuf>, Error> {
    Ok(files::entries(directory)?.into_iter().filter(|path| path.is_file()).collect())
}
