//! `mapper fleet work`: does a share of the items.

use crate::fleet_directory::with_fleet;
use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_fleet::{Hash, ItemSelection, Shard};
use serde_json::json;
use std::path::PathBuf;

/// Do a share of the items, as a task of a cluster does; finished items are skipped
#[derive(Debug, Args)]
pub struct Work {
    /// Directory of the study
    pub directory: PathBuf,
    /// Share K of N, from 1; it depends only on the hash of each item, not on other items
    #[arg(long, value_name = "K/N", required_unless_present = "item", conflicts_with = "item")]
    pub shard: Option<Shard>,
    /// One item, by its hash
    #[arg(long, value_name = "HASH")]
    pub item: Option<Hash>,
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

impl Work {
    pub fn run(&self) -> Result<(), Failure> {
        let which = match (self.item, self.shard) {
            (Some(hash), _) => ItemSelection::Item(hash),
            (None, Some(shard)) => ItemSelection::Shard(shard),
            // clap requires one of them.
            (None, None) => ItemSelection::All,
        };
        let outcome =
            with_fleet(&self.directory, self.jobs.map(usize::from), |fleet, kind, engine, machine| {
                fleet.work(kind, which, self.again, engine, machine)
            })?;
        if self.json {
            standard_output::print_json(
                &json!({ "done": outcome.done, "there": outcome.already_done, "failed": outcome.failed }),
            )?;
        } else {
            let failed = outcome.failed.iter().map(|(name, why)| format!("failed: {name}: {why}\n"));
            let failed: String = failed.collect();
            let (done, there) = (outcome.done, outcome.already_done);
            standard_output::print(&format!("{failed}{done} done, {there} were already done\n"))?;
        }
        if outcome.failed.is_empty() {
            return Ok(());
        }
        let message = format!("{} items failed; repeat them with `--again`", outcome.failed.len());
        Err(if self.json {
            Failure::printed(Code::Incomplete)
        } else {
            Failure::new(Code::Incomplete, message)
        })
    }
}
