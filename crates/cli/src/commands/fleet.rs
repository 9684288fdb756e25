//! `mapper fleet`.

use crate::command_line::subcommands::subcommands;
use crate::output::failure::Failure;
use clap::Args;

/// Work in many pieces on many cores or machines: maps, diagnoses, calibrations, studies
#[derive(Debug, Args)]
pub struct Fleet {
    /// What to do.
    #[command(subcommand)]
    command: FleetCommand,
}

subcommands! { FleetCommand:
    make::Make,
    estimate::Estimate,
    run::Run,
    work::Work,
    status::Status,
    merge::Merge,
    submit::Submit,
    retry::Retry,
}

impl Fleet {
    /// Runs the sub-command that was asked for.
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}
