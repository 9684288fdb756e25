//! `mapper`: from one campaign file to a compressor map.
//!
//! One file per command in `commands`: its options, its call, its words. The work is done in `mapper-session`;
//! `registry` alone names plug-ins.

mod terminal;
mod commands;
mod drivers;
mod ending;
mod exit_code;
mod failure;
mod fleet_place;
mod given;
mod interrupt;
mod output;
mod output_options;
mod registry;
mod rig_states;
mod shown;
mod standard_error;
mod subcommands;
mod tasks;
mod terminal_lines;
mod wall;

use clap::{CommandFactory, FromArgMatches, Parser};
use std::ffi::OsString;
use std::process::ExitCode;

/// From a campaign file to a complete turbocharger-compressor map, efficiency and heat transfer included.
#[derive(Debug, Parser)]
#[command(name = "mapper", version, after_help = exit_code::HELP, arg_required_else_help = true)]
struct Arguments {
    #[command(flatten)]
    manner: output_options::OutputOptions,
    /// What to do.
    #[command(subcommand)]
    command: commands::Command,
}

fn main() -> ExitCode {
    let raw: Vec<OsString> = std::env::args_os().collect();
    let (json, colour) = output_options::of_raw(&raw);
    let read = tasks::by_task(Arguments::command()).color(colour).try_get_matches_from(raw);
    let read = read.and_then(|matches| Ok((Arguments::from_arg_matches(&matches)?, matches)));
    match read {
        Ok((arguments, matches)) => {
            output_options::keep(&arguments.manner, &matches);
            output_options::keep_commands(Arguments::command);
            match arguments.command.run() {
                Ok(()) => ExitCode::SUCCESS,
                Err(failure) => ending::failed(&failure),
            }
        }
        Err(error) if error.use_stderr() && json => ending::wrong_arguments(&error),
        Err(error) => error.exit(),
    }
}
