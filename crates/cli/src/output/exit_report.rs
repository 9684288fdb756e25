//! Reports a failure at the end of the program.

use crate::output::failure::Failure;
use crate::output::{output_options, standard_output};
use serde_json::json;
use std::process::ExitCode;

/// Prints the failure, with `--json` as an object if none was printed yet.
pub fn failed(failure: &Failure) -> ExitCode {
    let Some(code) = failure.report() else { return ExitCode::SUCCESS };
    if output_options::json() && !standard_output::has_printed() {
        // If the reader has closed the pipe, the text is lost.
        let _ = standard_output::print_json(&failure.json());
    }
    code
}

/// Arguments that could not be read, as an object on standard output and as usual on standard error.
pub fn wrong_arguments(error: &clap::Error) -> ExitCode {
    let _ = error.print();
    let text = error.to_string();
    let mut parts = text.trim_start_matches("error: ").splitn(2, "\n\n").map(str::trim);
    let _ = standard_output::print_json(&json!({ "code": 2, "message": parts.next(), "help": parts.next() }));
    ExitCode::from(2)
}
