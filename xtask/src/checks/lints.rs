//! Lints and documentation.

use crate::error::Error;
use crate::files;
use crate::step::{command, output, say};
use crate::workspace;
use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::{Command, ExitCode};

/// The rustdoc that [`documenting`] stands in for.
const REAL_RUSTDOC: &str = "MAPPER_XTASK_RUSTDOC";

/// Clippy on every target of the workspace, with warnings denied.
pub fn clippy() -> Command {
    command(
        workspace::cargo(),
        &["clippy", "--locked", "--workspace", "--all-targets", "--quiet", "--", "-D", "warnings"],
    )
}

/// Compiles the members of the workspace with clippy, which is the compiler with more lints: what is built for the tests is not
/// checked a second time.
pub fn linting(mut build: Command) -> Command {
    build.env("RUSTC_WORKSPACE_WRAPPER", Path::new(&workspace::cargo()).with_file_name("clippy-driver"));
    build
}

/// An error where a finished build printed warnings: Cargo repeats them.
pub fn no_warnings(mut build: Command) -> Result<(), Error> {
    build.args(["--message-format", "json"]);
    let messages = output(build)?;
    let warnings = messages.lines().filter(|line| {
        line.contains(r#""reason":"compiler-message""#) && line.contains(r#""level":"warning""#)
    });
    match warnings.count() {
        0 => Ok(()),
        count => Err(Error::Warnings { count }),
    }
}

/// Lets the tests of the documentation also make the documentation: with the libraries of the tests, which `cargo doc` would check again.
///
/// The build of the workspace has replaced the file that this process was started from: the new one stands in.
pub fn documenting(mut tests: Command) -> Command {
    let program = format!("xtask{}", std::env::consts::EXE_SUFFIX);
    tests.env("RUSTDOC", workspace::target_dir().join("debug").join(program));
    tests.env(REAL_RUSTDOC, Path::new(&workspace::cargo()).with_file_name("rustdoc"));
    tests
}

/// Runs as the rustdoc of [`documenting`], if this process is it: the tests, then the documentation with warnings denied.
pub fn as_rustdoc() -> Option<ExitCode> {
    let rustdoc = std::env::var_os(REAL_RUSTDOC)?;
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let succeeds = |arguments: &[OsString]| {
        Command::new(&rustdoc).args(arguments).status().is_ok_and(|status| status.success())
    };
    let mut well = !has_examples(&arguments) || succeeds(&arguments);
    if arguments.iter().any(|argument| argument == "--test") {
        let out = workspace::target_dir().join("doc").into_os_string();
        let more = ["-D".into(), "warnings".into(), "--out-dir".into(), out];
        well &= succeeds(&[without_tests(&arguments), more.to_vec()].concat());
    }
    if !well {
        say("rustdoc failed\n");
    }
    Some(if well { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Whether the documentation of the crate may contain examples: to look for them, rustdoc reads the crate as thoroughly as for its pages.
fn has_examples(arguments: &[OsString]) -> bool {
    let root = arguments.iter().map(Path::new).find(|path| path.extension() == Some(OsStr::new("rs")));
    let files = root.and_then(Path::parent).and_then(|folder| files::rust_files(folder).ok());
    // Without readable sources, rustdoc decides.
    files.is_none_or(|files| {
        files.iter().any(|file| {
            files::read(file)
                .is_ok_and(|text| ["/// ```", "//! ```"].iter().any(|fence| text.contains(fence)))
        })
    })
}

/// Arguments of rustdoc without those that concern tests.
fn without_tests(arguments: &[OsString]) -> Vec<OsString> {
    let mut kept = Vec::new();
    let mut arguments = arguments.iter();
    while let Some(argument) = arguments.next() {
        if argument == "--test-run-directory" || argument == "--test-args" {
            arguments.next();
        } else if argument != "--test" && argument != OsStr::new("--no-run") {
            kept.push(argument.clone());
        }
    }
    kept
}
