//! `mapper fleet retry`: submits missing and failed items again.

use crate::fleet_directory::with_fleet;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_report::submission_text;
use std::path::PathBuf;

/// Submit tasks with missing or failed items again, with the options of the last submission
#[derive(Debug, Args)]
pub struct Retry {
    /// Directory of the study
    pub directory: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Retry {
    pub fn run(&self) -> Result<(), Failure> {
        let submission = with_fleet(&self.directory, None, |fleet, _, _, machine| fleet.retry(machine))?;
        if self.json {
            standard_output::print_json(&submission)
        } else {
            standard_output::print(&submission_text(&submission))
        }
    }
}
