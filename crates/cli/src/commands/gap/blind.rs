//! `mapper gap blind`: the check of the diagnosis on withheld data.

use crate::command_line::subcommands::subcommands;
use crate::output::failure::Failure;
use clap::Args;

/// Check the diagnosis on data whose causes are withheld
#[derive(Debug, Args)]
pub struct Blind {
    #[command(subcommand)]
    command: BlindCommand,
}

subcommands! { BlindCommand:
    make::Make,
    run::Run,
    score::Score,
    calibrate::Calibrate,
}

impl Blind {
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}
