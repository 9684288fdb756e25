//! `mapper gap`.

use crate::command_line::subcommands;
use crate::output::failure::Failure;
use clap::Args;

/// Diagnose the gap between nominal model and rig, and check that diagnosis on withheld data
#[derive(Debug, Args)]
pub struct Gap {
    #[command(subcommand)]
    command: GapCommand,
}

subcommands! { GapCommand:
    diagnose::Diagnose,
    correct::Correct,
    apply::Apply,
    predict::Predict,
    blind::Blind,
    effects::Effects,
}

impl Gap {
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}
