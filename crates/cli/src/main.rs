//! `mapper`: from one campaign file to a compressor map.
//!
//! One file per command in `commands`: its options, its call, its words. What is done stands in `mapper-session`;
//! `registry` alone names plug-ins.

mod commands;
mod drivers;
mod exit_code;
mod failure;
mod given;
mod interrupt;
mod output;
mod progress;
mod registry;
mod results_text;
mod rig_states;
mod subcommands;
mod wall;

use clap::Parser;
use std::process::ExitCode;

/// From a campaign file to a complete turbocharger-compressor map, efficiency and heat transfer included.
#[derive(Debug, Parser)]
#[command(name = "mapper", version, after_help = exit_code::HELP, arg_required_else_help = true)]
struct Arguments {
    /// What to do.
    #[command(subcommand)]
    command: commands::Command,
}

fn main() -> ExitCode {
    match Arguments::parse().command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
