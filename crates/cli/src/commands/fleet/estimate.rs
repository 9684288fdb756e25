//! `mapper fleet estimate`: estimated cost of a study.

use crate::fleet_directory::with_fleet;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_report::cost_text;
use std::path::PathBuf;

/// Estimate the cost of a study (items, processor hours, memory, disk) from a few items, whose results are kept
#[derive(Debug, Args)]
pub struct Estimate {
    /// Directory of the study
    pub directory: PathBuf,
    /// Number of items that must be done before the others are estimated
    #[arg(long = "try", value_name = "COUNT", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..))]
    pub tries: u16,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Estimate {
    pub fn run(&self) -> Result<(), Failure> {
        let tried = with_fleet(&self.directory, None, |fleet, kind, engine, machine| {
            fleet.estimate_cost(kind, self.tries.into(), engine, machine)
        })?;
        if self.json {
            standard_output::print_json(&tried.cost)
        } else {
            standard_output::print(&cost_text(&tried.cost))
        }
    }
}
