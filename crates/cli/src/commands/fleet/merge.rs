//! `mapper fleet merge`: from parts to the result.

use crate::fleet_place::in_fleet;
use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_report::merged_text;
use serde_json::json;
use std::path::PathBuf;

/// Merge all parts into the result that one machine would write; what is missing or failed is named
#[derive(Debug, Args)]
pub struct Merge {
    /// Directory of the study
    pub directory: PathBuf,
    /// Merge what there is, though something is missing
    #[arg(long)]
    pub partial: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Merge {
    /// Merges.
    pub fn run(&self) -> Result<(), Failure> {
        let merged = in_fleet(&self.directory, None, |fleet, kind, _, machine| {
            fleet.merge(kind, self.partial, machine)
        })?;
        let result = merged.result.as_ref().map(|(path, _)| path);
        if self.json {
            standard_output::print_json(&json!({ "status": merged.status, "result": result }))?;
        } else {
            standard_output::print(&merged_text(&merged))?;
        }
        if merged.status.lacking() == 0 {
            return Ok(());
        }
        let why = "items are missing or failed; `mapper fleet retry` submits them, `mapper fleet run --again` does them here";
        Err(if self.json { Failure::printed(Code::Incomplete) } else { Failure::new(Code::Incomplete, why) })
    }
}
