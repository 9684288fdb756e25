//! `mapper fleet run`: all of a study on this machine.

use crate::fleet_place::in_fleet;
use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_fleet::Which;
use mapper_report::merged_text;
use serde_json::json;
use std::path::PathBuf;

/// Do the remaining items of a study on this machine and merge it; stopped, the same command goes on from there
#[derive(Debug, Args)]
pub struct Run {
    /// Directory of the study
    pub directory: PathBuf,
    /// Number of items at a time [default: all cores]
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Also do those again that failed
    #[arg(long)]
    pub again: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Run {
    /// Works and merges.
    pub fn run(&self) -> Result<(), Failure> {
        let merged =
            in_fleet(&self.directory, self.jobs.map(usize::from), |fleet, kind, engine, machine| {
                fleet.work(kind, Which::All, self.again, engine, machine)?;
                fleet.merge(kind, false, machine)
            })?;
        let result = merged.result.as_ref().map(|(path, _)| path);
        if self.json {
            standard_output::print_json(&json!({ "status": merged.status, "result": result }))?;
        } else {
            standard_output::print(&merged_text(&merged))?;
        }
        if result.is_some() {
            return Ok(());
        }
        let why = "items are missing or failed; `--again` does those again that failed";
        Err(if self.json { Failure::printed(Code::Incomplete) } else { Failure::new(Code::Incomplete, why) })
    }
}
