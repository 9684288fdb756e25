//! `mapper map`.

use crate::command_line::subcommands::subcommands;
use crate::output::failure::Failure;
use clap::Args;

/// Fit, convert and compare compressor maps
#[derive(Debug, Args)]
pub struct Map {
    #[command(subcommand)]
    command: MapCommand,
}

subcommands! { MapCommand:
    inspect::Inspect,
    fit::Fit,
    convert::Convert,
    compare::Compare,
    reduce::Reduce,
    correct::Correct,
    rig::Rig,
    fmu::Fmu,
}

impl Map {
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}
