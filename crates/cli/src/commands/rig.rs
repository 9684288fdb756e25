//! `mapper rig`.

use crate::output::failure::Failure;
use crate::{output::standard_output, rig_states};
use clap::{Args, Subcommand};
use mapper_session::{RigStates, RigStatus};
use std::path::PathBuf;

/// Show the lock and the lockout of a rig, and acknowledge that it is safe to be run again
#[derive(Debug, Args)]
pub struct Rig {
    /// What to do.
    #[command(subcommand)]
    command: RigCommand,
    /// Directory of the locks and latches; that of the user if none is given
    #[arg(long, value_name = "DIR", global = true)]
    pub states: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long, global = true)]
    pub json: bool,
}

/// What to do with a rig.
#[derive(Debug, Subcommand)]
enum RigCommand {
    /// Say who has a rig, and why it is latched; without a name, of each that a run has had
    Status {
        /// Name of the rig, as its backend says it
        rig: Option<String>,
    },
    /// Confirm that the rig has been inspected: the next run may begin
    Acknowledge {
        /// Name of the rig, as its backend says it
        rig: String,
    },
}

impl Rig {
    /// Tells or clears the state of a rig.
    pub fn run(&self) -> Result<(), Failure> {
        let states = RigStates::new(&rig_states::directory(self.states.as_deref()));
        let (status, cleared) = match &self.command {
            RigCommand::Status { rig: None } => return self.tell_all(&states.known()),
            RigCommand::Status { rig: Some(rig) } => (states.status(rig)?, false),
            RigCommand::Acknowledge { rig } => (states.acknowledge(rig)?, true),
        };
        if self.json {
            return standard_output::print_json(&status);
        }
        let text = text(&status, cleared);
        if status.owner.is_some() || status.latch.is_some() {
            return standard_output::print(&text);
        }
        // A name that is not quite the rig's would say that all is well.
        let known: Vec<String> = states.known().into_iter().map(|status| status.rig).collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        standard_output::print(&format!("{text}rigs that runs have had from here: {known}\n"))
    }

    fn tell_all(&self, known: &[RigStatus]) -> Result<(), Failure> {
        if self.json {
            return standard_output::print_json(&serde_json::json!({"rigs": known}));
        }
        let lines: String = known.iter().map(|status| text(status, false)).collect();
        let none = "no run has had a rig from here\n";
        standard_output::print(if lines.is_empty() { none } else { &lines })
    }
}

fn text(status: &RigStatus, cleared: bool) -> String {
    let mut lines = Vec::new();
    match (&status.owner, status.in_use) {
        (Some(owner), true) => lines.push(format!("in use by {owner}")),
        (Some(owner), false) => lines.push(format!(
            "left by {owner}, which ended with the rig in its hands (a driver makes it safe by itself then); look at the rig"
        )),
        (None, _) => lines.push("not in use".to_owned()),
    }
    if let Some(latch) = &status.latch {
        lines.push(format!("latched since the run {}: {}", latch.run.display(), latch.reason));
    }
    if cleared {
        lines.push("acknowledged: the next run may begin".to_owned());
    }
    lines.iter().map(|line| format!("{}: {line}\n", status.rig)).collect()
}
