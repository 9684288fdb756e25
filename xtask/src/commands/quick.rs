//! `cargo xtask quick`: fast checks during development.

use crate::checks::formatting::formatting;
use crate::checks::tally::Tally;
use crate::error::Error;
use crate::files::Mode;
use crate::step::{Steps, command, run, say};
use crate::{
    checks::{lints, test_programs},
    environment::machine,
    workspace,
};

const LEFT_OUT: &str = "
LEFT OUT, run by `cargo xtask test`: tests of the whole program and of documents, tests of more than some seconds
(.config/nextest.toml), examples in the documentation, licences of dependencies, generated documents.
";

/// Formatting, lints, fast tests.
pub fn quick() -> Result<(), Error> {
    let mut steps = Steps::default();
    steps.run("formatting", || formatting(Mode::Check));
    steps.run("lints", || run(lints::clippy()));
    steps.run("tests", || {
        let mut tally = Tally::default();
        let tests = if machine::has_nextest() {
            test_programs::tests("quick", |cores| cores + 2)
        } else {
            // Without nextest, tests cannot be skipped by name; only the fast tests inside the libraries are run.
            cargo(&["test", "--locked", "--workspace", "--no-fail-fast", "--lib"])
        };
        let well = test_programs::run(tests, &mut tally)?;
        test_programs::close(&tally, well)
    });
    let result = steps.finish();
    say(LEFT_OUT);
    if !machine::has_nextest() {
        say(
            "nextest is missing: the tests in `tests` folders were left out too; cargo install cargo-nextest --locked\n",
        );
    }
    result
}

fn cargo(arguments: &[&str]) -> std::process::Command {
    command(workspace::cargo(), arguments)
}
