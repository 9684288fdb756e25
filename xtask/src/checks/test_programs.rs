//! Runs test programs and counts their tests.

use crate::checks::tally::Tally;
use crate::error::Error;
use crate::step::{self, say};
use crate::{environment::machine, workspace};
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};

/// Runs the tests of the workspace with nextest, which runs them in parallel across all programs, or with `cargo test` if nextest is missing. `profile` is one of `.config/nextest.toml`; `threads_of` returns its number of threads for a number of cores.
pub fn tests(profile: &str, threads_of: impl Fn(usize) -> usize) -> Command {
    if machine::has_nextest() {
        let arguments = [
            "nextest",
            "run",
            "--locked",
            "--workspace",
            "--all-features",
            "--no-fail-fast",
            "--profile",
            profile,
        ];
        let mut command =
            step::command(workspace::cargo(), &[&arguments[..], &["--color", "never"]].concat());
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        command.arg("--test-threads").arg(threads_of(cores).to_string());
        command
    } else {
        step::command(
            workspace::cargo(),
            &[
                "test",
                "--locked",
                "--workspace",
                "--all-features",
                "--no-fail-fast",
                "--lib",
                "--bins",
                "--tests",
            ],
        )
    }
}

/// Runs the examples in the documentation.
pub fn documentation_tests() -> Command {
    step::command(
        workspace::cargo(),
        &["test", "--locked", "--workspace", "--all-features", "--doc", "--no-fail-fast"],
    )
}

/// Runs a command with its output shown, and counts the tests in it. `Ok(false)` if some failed.
pub fn run(mut command: Command, tally: &mut Tally) -> Result<bool, Error> {
    let text = step::line(&command);
    say(&format!("$ {text}\n"));
    let start = |source| Error::Start { command: text.clone(), source };
    // nextest reports on standard error, `cargo test` on standard output.
    let by_nextest = text.contains(" nextest ");
    let (out, err) =
        if by_nextest { (Stdio::inherit(), Stdio::piped()) } else { (Stdio::piped(), Stdio::inherit()) };
    let mut child = command.stdout(out).stderr(err).spawn().map_err(start)?;
    let report: Option<Box<dyn Read>> = if by_nextest {
        child.stderr.take().map(|stream| Box::new(stream) as _)
    } else {
        child.stdout.take().map(|stream| Box::new(stream) as _)
    };
    if let Some(report) = report {
        // Read as bytes, because a test may print invalid UTF-8.
        for line in BufReader::new(report).split(b'\n').map_while(Result::ok) {
            let line = String::from_utf8_lossy(&line);
            tally.count(&line);
            say(&format!("{line}\n"));
        }
    }
    Ok(child.wait().map_err(start)?.success())
}

/// Prints the summary line; an error if tests failed.
pub fn close(tally: &Tally, well: bool) -> Result<(), Error> {
    let verdict = if well { "ok" } else { "FAILED" };
    let Tally { passed, failed, ignored } = tally;
    say(&format!(
        "test result: {verdict}. {passed} passed; {failed} failed; {ignored} ignored (all test programs)\n"
    ));
    if well { Ok(()) } else { Err(Error::Failed { command: "the tests".to_owned() }) }
}
