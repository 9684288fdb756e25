//! `cargo xtask test`: everything that has to hold.

use crate::error::Error;
use crate::step::{self, Steps, command, run, say};
use crate::{machine, python_env, workspace};
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Formatting, lints, tests, documentation. All are run even where one fails; only preparations end it early.
pub fn test() -> Result<(), Error> {
    let mut steps = Steps::default();
    let mut python = None;
    steps.run("tools", machine::prepare);
    if steps.all_well() {
        steps.run("Python environment", || {
            python = Some(python_env::prepare()?);
            Ok(())
        });
    }
    let Some(python) = python else { return steps.finish() };
    let mountable = machine::can_mount();
    steps.run("formatting", || run(cargo(&["fmt", "--all", "--check"])));
    steps.run("lints", || {
        run(cargo(&["clippy", "--workspace", "--all-targets", "--quiet", "--", "-D", "warnings"]))
    });
    steps.run("documentation", || {
        let mut command = cargo(&["doc", "--no-deps", "--workspace", "--quiet"]);
        command.env("RUSTDOCFLAGS", "-D warnings");
        run(command)
    });
    let offered = Offered { python, mountable };
    steps.run("building", || {
        // The program in one go with all tests: alone it would have other features of some libraries, and they
        // would be built twice.
        run(offered.to(cargo(&["build", "--workspace", "--bins", "--tests", "--quiet"])))
    });
    steps.run("tests", || tests(&offered));
    let result = steps.finish();
    if !mountable {
        say(
            "\nLEFT OUT: the test of a full disk. It mounts a small tmpfs: run `cargo xtask test` as root.\n",
        );
    }
    result
}

fn cargo(arguments: &[&str]) -> Command {
    command(workspace::cargo(), arguments)
}

/// What this machine offers to tests that need more than Rust.
struct Offered {
    python: PathBuf,
    mountable: bool,
}

impl Offered {
    /// A command that knows of it. All commands that build get the same, so that nothing is built again.
    fn to(&self, mut command: Command) -> Command {
        command.env("MAPPER_TEST_PYTHON", &self.python);
        command.env("MAPPER_TEST_CHROMIUM", "chromium");
        if self.mountable {
            command.env("MAPPER_TEST_TMPFS", "1");
        }
        command
    }
}

/// All tests and documentation tests. `cargo test` on any machine, so that all see the same; none may be ignored.
fn tests(offered: &Offered) -> Result<(), Error> {
    let mountable = offered.mountable;
    let mut command = offered.to(cargo(&["test", "--workspace", "--no-fail-fast"]));
    command.env("MAPPER_TEST_PROGRAM", workspace::target_dir().join("debug/mapper"));
    let text = step::line(&command);
    say(&format!("$ {text}\n"));
    let mut child = command
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|source| Error::Start { command: text.clone(), source })?;
    let mut tally = Tally::default();
    if let Some(stdout) = child.stdout.take() {
        // By bytes: a test may print anything.
        for line in BufReader::new(stdout).split(b'\n').map_while(Result::ok) {
            let line = String::from_utf8_lossy(&line);
            tally.count(&line);
            say(&format!("{line}\n"));
        }
    }
    let status = child.wait().map_err(|source| Error::Start { command: text.clone(), source })?;
    let verdict = if status.success() { "ok" } else { "FAILED" };
    let Tally { passed, failed, ignored } = tally;
    say(&format!(
        "test result: {verdict}. {passed} passed; {failed} failed; {ignored} ignored (all test programs)\n"
    ));
    if !status.success() {
        return Err(Error::Failed { command: text });
    }
    // The test of a full disk is the one that may be missing, and is named at the end.
    let left_out = ignored.saturating_sub(usize::from(!mountable));
    if left_out > 0 { Err(Error::LeftOut { count: left_out }) } else { Ok(()) }
}

/// Sums over the closing lines of all test programs.
#[derive(Debug, Default, PartialEq)]
struct Tally {
    passed: usize,
    failed: usize,
    ignored: usize,
}

impl Tally {
    fn count(&mut self, line: &str) {
        let Some(counts) = line.strip_prefix("test result: ") else { return };
        for part in counts.split(['.', ';']) {
            let mut words = part.split_whitespace();
            let (Some(Ok(number)), Some(what)) = (words.next().map(str::parse::<usize>), words.next()) else {
                continue;
            };
            match what {
                "passed" => self.passed += number,
                "failed" => self.failed += number,
                "ignored" => self.ignored += number,
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Tally;

    /// The line as `cargo test` of Rust 1.95 writes it.
    #[test]
    fn closing_lines_add_up() {
        let mut tally = Tally::default();
        for line in [
            "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; finished in 0.25s",
            "test some::test ... ok",
            "test result: FAILED. 1 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 10.00s",
        ] {
            tally.count(line);
        }
        assert_eq!(tally, Tally { passed: 13, failed: 2, ignored: 1 });
    }
}
