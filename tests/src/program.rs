//! Builds the program once, and runs it as a user does.

use crate::repository;
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The built program.
///
/// A test of one package does not know the path of another package's binary, so Cargo builds it and reports the path. `cargo xtask test`
/// has already built it and passes the path.
fn binary() -> &'static Path {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    BINARY.get_or_init(|| {
        if let Some(built) = std::env::var_os("MAPPER_TEST_PROGRAM") {
            return built.into();
        }
        build(&["--package", "mapper-cli", "--bin", "mapper"])
            .lines()
            .filter_map(|line| serde_json::from_str::<Value>(line).ok())
            .find_map(|message| Some(PathBuf::from(message["executable"].as_str()?)))
            .expect("cargo names the program it built")
    })
}

fn build(options: &[&str]) -> String {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(["build", "--locked"]).args(options);
    command.arg("--message-format=json-render-diagnostics").current_dir(repository());
    // Optimised if the tests are.
    if !cfg!(debug_assertions) {
        command.arg("--release");
    }
    let output = command.output().expect("cargo can be started");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Builds the drivers, which are then next to the program; `cargo xtask test` has built them with everything else.
pub fn build_drivers() {
    static BUILT: OnceLock<()> = OnceLock::new();
    BUILT.get_or_init(|| {
        if std::env::var_os("MAPPER_TEST_PROGRAM").is_none() {
            build(&["--package", "mapper-backend-lab", "--package", "mapper-backend-modbus"]);
        }
    });
}

/// Builds a driver that few tests need; `cargo xtask test` has built it with everything else.
pub fn build_driver(package: &str) {
    if std::env::var_os("MAPPER_TEST_PROGRAM").is_none() {
        build(&["--package", package]);
    }
}

/// The program with arguments, to be started in the root of the repository; standard input is closed.
pub fn mapper_command<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Command {
    let mut command = Command::new(binary());
    command.args(arguments).current_dir(repository()).stdin(std::process::Stdio::null());
    // Ignore the developer's own settings.
    command.env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE").env_remove("FORCE_COLOR");
    command
}

/// Result of a run of the program.
#[derive(Debug)]
pub struct Finished {
    /// Exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl From<Output> for Finished {
    fn from(output: Output) -> Self {
        Finished {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).expect("standard output is UTF-8"),
            stderr: String::from_utf8(output.stderr).expect("standard error is UTF-8"),
        }
    }
}

impl Finished {
    /// Asserts the exit code; on failure, shows the output.
    #[track_caller]
    pub fn exits(self, code: i32) -> Self {
        assert_eq!(
            self.code,
            Some(code),
            "standard error:\n{}\nstandard output:\n{}",
            self.stderr,
            self.stdout
        );
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        self
    }

    /// Whether standard error contains this text, ignoring line breaks.
    pub fn mentions(&self, text: &str) -> bool {
        self.stderr.split_whitespace().collect::<Vec<_>>().join(" ").contains(text)
    }

    /// Parses standard output, which must be one JSON object.
    #[track_caller]
    pub fn json(&self) -> Value {
        let value: Value = serde_json::from_str(&self.stdout).unwrap_or_else(|error| {
            panic!("standard output is not one JSON object: {error}\n{}", self.stdout)
        });
        assert!(value.is_object(), "{value}");
        value
    }
}

/// Runs the program to its end with pipes for its output, in the root of the repository.
pub fn mapper<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Finished {
    mapper_in(&repository(), arguments)
}

/// Runs the program to its end with pipes for its output.
pub fn mapper_in<S: AsRef<OsStr>>(directory: &Path, arguments: impl IntoIterator<Item = S>) -> Finished {
    mapper_command(arguments).current_dir(directory).output().expect("the program can be started").into()
}
