//! `mapper fleet`.

use crate::command_line::subcommands::subcommands;
use crate::output::failure::Failure;
use clap::Args;

/// Run studies of many items on many cores or computers: maps, diagnoses, calibrations
#[derive(Debug, Args)]
pub struct Fleet {
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
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}
