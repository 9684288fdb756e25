//! `mapper fleet estimate`: what a study costs, before it is run.

use crate::fleet_place::in_fleet;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_report::cost_text;
use std::path::PathBuf;

/// Say what a study takes: items, processor hours, memory, disk, from a few items that are tried and stay done
#[derive(Debug, Args)]
pub struct Estimate {
    /// Directory of the study
    pub directory: PathBuf,
    /// Number of items that have to be done before the rest is reckoned
    #[arg(long = "try", value_name = "COUNT", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..))]
    pub tries: u16,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Estimate {
    /// Tries some, says what all cost.
    pub fn run(&self) -> Result<(), Failure> {
        let tried = in_fleet(&self.directory, None, |fleet, kind, engine, machine| {
            fleet.tried(kind, self.tries.into(), engine, machine)
        })?;
        if self.json {
            standard_output::print_json(&tried.cost)
        } else {
            standard_output::print(&cost_text(&tried.cost))
        }
    }
}
