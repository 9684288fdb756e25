//! `mapper fleet run`: runs a whole study on this computer.

use crate::commands::fleet::merge::print_merged;
use crate::fleet_directory::with_fleet;
use crate::output::failure::Failure;
use clap::Args;
use mapper_fleet::ItemSelection;
use std::path::PathBuf;

/// Do the remaining items of a study on this computer and merge it; after a stop, the same command continues
#[derive(Debug, Args)]
pub struct Run {
    /// Directory of the study
    pub directory: PathBuf,
    /// Number of items at a time [default: all cores]
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Also repeat failed items
    #[arg(long)]
    pub again: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Run {
    pub fn run(&self) -> Result<(), Failure> {
        let merged =
            with_fleet(&self.directory, self.jobs.map(usize::from), |fleet, kind, engine, machine| {
                fleet.work(kind, ItemSelection::All, self.again, engine, machine)?;
                fleet.merge(kind, false, machine)
            })?;
        let reason = "items are missing or failed; repeat the failed ones with `--again`";
        print_merged(&merged, self.json, merged.result.is_some(), reason)
    }
}
