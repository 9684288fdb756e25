//! Reports a failure at the end of the program.

use crate::output::failure::Failure;
use crate::output::standard_error::say;
use crate::output::{output_options, standard_output};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use mapper_core::terminal_text;
use serde_json::json;
use std::panic::set_hook;
use std::process::ExitCode;

/// Prints a panic as one line: a thread that the system refuses, or a defect.
pub fn explain_defects() {
    set_hook(Box::new(|panic| {
        let text = panic.to_string().replace('\n', " ");
        let is_refused =
            ["failed to spawn thread", "ThreadPoolBuildError"].iter().any(|part| text.contains(part));
        say(&if is_refused {
            "mapper: the system cannot start another thread; raise its limits (`ulimit -u`, `ulimit -v`)\n"
                .to_owned()
        } else {
            format!("mapper: the program has a defect: {}; please report it\n", terminal_text(&text))
        });
    }));
}

/// Prints the failure, with `--json` as an object if none was printed yet.
pub fn failed(failure: &Failure) -> ExitCode {
    let Some(code) = failure.report() else { return ExitCode::SUCCESS };
    if output_options::json() && !standard_output::has_printed() {
        // If the reader has closed the pipe, the text is lost.
        let _ = standard_output::print_json(&failure.json());
    }
    code
}

/// Arguments that could not be read: as usual on standard error, and with `--json` as an object on standard output. Clap's own tip for an
/// argument that no option takes would pass an option as the name of a file.
pub fn wrong_arguments(mut error: clap::Error, json: bool) -> ExitCode {
    let tip = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(word)) if word == "--seed" => {
            "the seed is a key of the campaign, e.g. `seed: 2`"
        }
        _ => "quote a value with blanks, e.g. \"60 mm\"; write an optional one after `=`, e.g. `--live=9999`",
    };
    if error.kind() == ErrorKind::UnknownArgument && error.get(ContextKind::SuggestedArg).is_none() {
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.to_owned().into()]));
    }
    let text = error.to_string();
    // The colours of clap would let those of an argument pass.
    if terminal_text(&text) == text {
        let _ = error.print();
    } else {
        say(&text);
    }
    if json {
        let mut parts = text.trim_start_matches("error: ").splitn(2, "\n\n").map(str::trim);
        let value = json!({ "code": 2, "message": parts.next(), "help": parts.next() });
        let _ = standard_output::print_json(&value);
    }
    ExitCode::from(2)
}
