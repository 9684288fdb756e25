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

use clap::{CommandFactory, FromArgMatches, Parser};
use output::exit_report;
use output::failure::{Code, Failure};
use std::ffi::OsString;
use std::panic::AssertUnwindSafe;
use std::process::ExitCode;

/// From a campaign file to a complete turbocharger-compressor map, efficiency and heat transfer included.
#[derive(Debug, Parser)]
#[command(name = "mapper", version, after_help = output::failure::HELP, arg_required_else_help = true)]
struct Arguments {
    #[command(flatten)]
    manner: output::output_options::OutputOptions,
    #[command(subcommand)]
    command: commands::Command,
}

fn main() -> ExitCode {
    exit_report::explain_defects();
    interrupt::end_without_memory();
    let raw: Vec<OsString> = std::env::args_os().collect();
    let (json, colour) = output::output_options::scan_raw_arguments(&raw);
    let read = command_line::by_task(Arguments::command()).color(colour).try_get_matches_from(raw);
    let read = read.and_then(|matches| Ok((Arguments::from_arg_matches(&matches)?, matches)));
    match read {
        Ok((arguments, matches)) => {
            output::output_options::set_options(&arguments.manner, &matches);
            output::output_options::set_commands(Arguments::command);
            // The message of a defect has been printed where it happened.
            let run = std::panic::catch_unwind(AssertUnwindSafe(|| arguments.command.run()));
            match run.unwrap_or_else(|_| Err(Failure::printed(Code::Failure))) {
                Ok(()) => ExitCode::SUCCESS,
                Err(failure) => exit_report::failed(&failure),
            }
        }
        Err(error) if error.use_stderr() => exit_report::wrong_arguments(error, json),
        Err(error) => error.exit(),
    }
}
