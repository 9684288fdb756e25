//! `mapper rig`.

use crate::commands::commission::Commission;
use crate::environment::rig_states_directory;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::{Args, Subcommand};
use mapper_session::{RigStates, RigStatus, since_text};
use std::path::PathBuf;

/// Measure how a stand moves; show the lock and the lockout of a rig, and acknowledge that it is safe to run again
#[derive(Debug, Args)]
pub struct Rig {
    #[command(subcommand)]
    command: RigCommand,
    /// Directory of locks and lockouts [default: the one that all users share]
    #[arg(long, value_name = "DIR", global = true)]
    pub states: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long, global = true)]
    pub json: bool,
}

#[derive(Debug, Subcommand)]
enum RigCommand {
    Commission(Commission),
    /// Show the owner and the lockout of a rig, or of all rigs used so far
    Status {
        /// Name of the rig, as reported by its backend
        rig: Option<String>,
    },
    /// Confirm that the rig was inspected, so that the next run may start
    Acknowledge {
        /// Name of the rig, as reported by its backend
        rig: String,
    },
}

impl Rig {
    pub fn run(&self) -> Result<(), Failure> {
        let states = RigStates::new(&rig_states_directory(self.states.as_deref()));
        let (status, cleared) = match &self.command {
            RigCommand::Commission(commission) => return commission.run(self.states.as_deref(), self.json),
            RigCommand::Status { rig: None } => return self.print_all(&states.list()),
            RigCommand::Status { rig: Some(rig) } => (states.status(rig)?, false),
            RigCommand::Acknowledge { rig } => (states.acknowledge(rig)?, true),
        };
        if self.json {
            return standard_output::print_json(&status);
        }
        let text = status_text(&status, cleared);
        if status.owner.is_some() || status.latch.is_some() {
            return standard_output::print(&text);
        }
        // A mistyped name would otherwise look like a rig that is not in use.
        let known: Vec<String> = states.list().into_iter().map(|status| status.rig).collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        standard_output::print(&format!("{text}rigs used so far: {known}\n"))
    }

    fn print_all(&self, known: &[RigStatus]) -> Result<(), Failure> {
        if self.json {
            return standard_output::print_json(&serde_json::json!({"rigs": known}));
        }
        let lines: String = known.iter().map(|status| status_text(status, false)).collect();
        let none = "no rig has been used so far\n";
        standard_output::print(if lines.is_empty() { none } else { &lines })
    }
}

fn status_text(status: &RigStatus, cleared: bool) -> String {
    let mut lines = Vec::new();
    match (&status.owner, status.in_use) {
        (Some(owner), true) => lines.push(format!("in use by {owner}")),
        (Some(owner), false) => lines.push(format!(
            "not released by {owner}, which has ended (its driver should have made the rig safe); inspect the rig"
        )),
        (None, _) => lines.push("not in use".to_owned()),
    }
    if let Some(latch) = &status.latch {
        lines.push(format!("locked out{}: {}", since_text(&latch.run), latch.reason));
    }
    if cleared {
        lines.push("acknowledged: the next run may start".to_owned());
    }
    lines.iter().map(|line| format!("{}: {line}\n", status.rig)).collect()
}
