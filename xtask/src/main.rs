//! Chores of the repository: `cargo xtask quick`, `test`, `fleet-test`, `fmt`, `docs`, `python`, `wheel` and `performance`.

mod constants;
mod docs;
mod error;
mod fleet_test;
mod formatting;
mod lints;
mod machine;
mod offered;
mod performance;
mod python_env;
mod python_package;
mod quick;
mod step;
mod tally;
mod test;
mod test_programs;
mod workspace;

use std::process::ExitCode;

const USAGE: &str = "\
usage: cargo xtask COMMAND

  quick          formatting, lints and the tests that are fast: while working; lists the omitted ones
  test           run every test of the repository; installs what they need, skips nothing
  fleet-test     the tests of fleets alone, on Slurm with them: as root, which Slurm's daemons need
  fmt            format every file, those included that a macro declares and `cargo fmt` does not see
  docs           make the generated documents again
  docs --check   fail where a generated document is not what the program makes now
  python         the tests of the Python package alone
  wheel          build the Python package's wheel and test it in an empty environment
  performance    measure, with peers for comparison if they can be built, and write docs/validation/performance.md
";

#[allow(clippy::print_stderr)]
fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match arguments.as_slice() {
        ["quick"] => quick::quick(),
        ["test"] => test::test(),
        ["fleet-test"] => fleet_test::fleet_test(),
        ["fmt"] => formatting::formatting(formatting::Mode::Write),
        ["docs"] => docs::docs(docs::Mode::Write),
        ["docs", "--check"] => docs::docs(docs::Mode::Check),
        ["python"] => test::python(),
        ["wheel"] => python_package::wheel(),
        ["performance"] => performance::performance(),
        ["--help" | "-h" | "help"] => {
            step::say(USAGE);
            return ExitCode::SUCCESS;
        }
        _ => {
            eprint!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("\nxtask: {error}");
            ExitCode::FAILURE
        }
    }
}
