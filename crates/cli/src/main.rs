//! The command line program `mapper`: from a campaign file to a compressor map.
//!
//! `commands` has one file for each command, with its options and its output. `mapper-session` does the work, with the
//! plug-ins of the crate `mapper`.

mod command_line;
mod commands;
mod environment;
mod interrupt;
mod output;
mod terminal;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches, Parser};
use mapper_core::terminal_text;
use output::failure::{Code, Failure};
use output::standard_error::say;
use output::{output_options, standard_output};
use serde_json::json;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, set_hook};
use std::process::ExitCode;

/// From a campaign file to a complete turbocharger-compressor map, efficiency and heat transfer included.
#[derive(Debug, Parser)]
#[command(name = "mapper", version, after_help = output::failure::HELP, arg_required_else_help = true)]
struct Arguments {
    #[command(flatten)]
    manner: output_options::OutputOptions,
    #[command(subcommand)]
    command: commands::Command,
}

fn main() -> ExitCode {
    explain_defects();
    interrupt::end_without_memory();
    let raw: Vec<OsString> = std::env::args_os().collect();
    let (json, colour) = output_options::scan_raw_arguments(&raw);
    let read = command_line::by_task(Arguments::command()).color(colour).try_get_matches_from(raw);
    let read = read.and_then(|matches| Ok((Arguments::from_arg_matches(&matches)?, matches)));
    match read {
        Ok((arguments, matches)) => {
            output_options::set_options(&arguments.manner, &matches);
            output_options::set_commands(Arguments::command);
            // The message of a defect has been printed where it happened.
            let run = std::panic::catch_unwind(AssertUnwindSafe(|| arguments.command.run()));
            match run.unwrap_or_else(|_| Err(Failure::printed(Code::Failure))) {
                Ok(()) => ExitCode::SUCCESS,
                Err(failure) => failed(&failure),
            }
        }
        Err(error) if error.use_stderr() => wrong_arguments(error, json),
        Err(error) => error.exit(),
    }
}

/// Prints a panic as one line: a thread that the system refuses, or a defect.
fn explain_defects() {
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
fn failed(failure: &Failure) -> ExitCode {
    let Some(code) = failure.report() else { return ExitCode::SUCCESS };
    if output_options::json() && !standard_output::has_printed() {
        // If the reader has closed the pipe, the text is lost.
        let _ = standard_output::print_json(&failure.json());
    }
    code
}

/// Arguments that could not be read: as usual on standard error, and with `--json` as an object on standard output. Clap's own tip for an
/// argument that no option takes would pass an option as the name of a file.
fn wrong_arguments(mut error: clap::Error, json: bool) -> ExitCode {
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
