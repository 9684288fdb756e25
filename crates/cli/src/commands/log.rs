//! `mapper log`.

use crate::command_line::subcommands::subcommands;
use crate::output::failure::Failure;
use clap::Args;

/// Look into the log of a test stand
#[derive(Debug, Args)]
pub struct Log {
    #[command(subcommand)]
    command: LogCommand,
}

subcommands! { LogCommand:
    inspect::Inspect,
}

impl Log {
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}
