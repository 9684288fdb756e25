//! `mapper fleet retry`: what is missing, once more.

use crate::fleet_place::in_fleet;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_report::submission_text;
use std::path::PathBuf;

/// Submit the tasks again whose items are missing or failed, as the study was submitted before
#[derive(Debug, Args)]
pub struct Retry {
    /// Directory of the study
    pub directory: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Retry {
    /// Submits.
    pub fn run(&self) -> Result<(), Failure> {
        let submission = in_fleet(&self.directory, None, |fleet, _, _, machine| fleet.retry(machine))?;
        if self.json {
            standard_output::print_json(&submission)
        } else {
            standard_output::print(&submission_text(&submission))
        }
    }
}
