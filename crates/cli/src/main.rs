//! `mapper`: from one campaign file to a compressor map.
//!
//! One file per command in `commands`; `registry` alone names plug-ins; `assembly_line` turns a campaign into what
//! each crate of the way needs.

mod arguments;
mod assembly_line;
mod commands;
mod drive;
mod exit_code;
mod failure;
mod gap_arguments;
mod history_picture;
mod interrupt;
mod map_comparison_picture;
mod map_file;
mod nightly_run;
mod observers;
mod output;
mod plan_picture;
mod predicted_method;
mod registry;
mod repeated_jumps;
mod results;
mod run_directory;
mod sequence_run;
mod table;
mod test_report;
mod thermal_text;
mod zero;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = arguments::Arguments::parse();
    match commands::dispatch(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
