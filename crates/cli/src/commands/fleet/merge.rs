//! `mapper fleet merge`: merges parts into the result.

use crate::fleet_directory::with_fleet;
use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_fleet::MergeOutcome;
use mapper_report::merged_text;
use serde_json::json;
use std::path::PathBuf;

/// Merge all parts into the result that one computer would write; missing and failed items are listed
#[derive(Debug, Args)]
pub struct Merge {
    /// Directory of the study
    pub directory: PathBuf,
    /// Merge even if items are missing or failed
    #[arg(long)]
    pub partial: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Merge {
    pub fn run(&self) -> Result<(), Failure> {
        let merged = with_fleet(&self.directory, None, |fleet, kind, _, machine| {
            fleet.merge(kind, self.partial, machine)
        })?;
        let reason = "items are missing or failed; submit them again with `mapper fleet retry`, or run them here with `mapper fleet run --again`";
        print_merged(&merged, self.json, merged.status.unfinished() == 0, reason)
    }
}

/// Prints a merge; fails with `reason` if it is incomplete.
pub fn print_merged(
    merged: &MergeOutcome,
    json: bool,
    is_complete: bool,
    reason: &str,
) -> Result<(), Failure> {
    if json {
        let result = merged.result.as_ref().map(|(path, _)| path);
        standard_output::print_json(&json!({ "status": merged.status, "result": result }))?;
    } else {
        standard_output::print(&merged_text(merged))?;
    }
    if is_complete {
        return Ok(());
    }
    Err(if json { Failure::printed(Code::Incomplete) } else { Failure::new(Code::Incomplete, reason) })
}
