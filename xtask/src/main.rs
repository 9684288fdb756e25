//! Developer commands of the repository: `cargo xtask quick`, `test`, `fleet-test`, `fmt`, `docs`, `python`, `wheel`, `package` and `performance`.

mod checks;
mod commands;
mod environment;
mod error;
mod files;
mod step;
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
  wheel          build the Python package's wheel, all programs in it, and use it in an empty environment
                 --target aarch64: for another computer, not used
  package        build the archive and the Debian package, and use them; as root, in a Debian of its own
  performance    measure, with peers for comparison if they can be built, and write docs/validation/performance.md
";

#[allow(clippy::print_stderr)]
fn main() -> ExitCode {
    if let Some(code) = checks::lints::as_rustdoc() {
        return code;
    }
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match arguments.as_slice() {
        ["quick"] => commands::quick::quick(),
        ["test"] => commands::test::test(),
        ["fleet-test"] => commands::fleet_test::fleet_test(),
        ["fmt"] => checks::formatting::formatting(files::Mode::Write),
        ["docs"] => commands::docs::docs(files::Mode::Write),
        ["docs", "--check"] => commands::docs::docs(files::Mode::Check),
        ["python"] => commands::test::python(),
        ["wheel" | "package", ..] => checks::python_package::release(&arguments),
        ["performance"] => commands::performance::performance(),
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
