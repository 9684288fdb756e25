//! `mapper fleet status`: progress of a study.

use crate::fleet_directory::with_machine;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_fleet::{Fleet, Template, query_task_states};
use mapper_report::status_text;
use mapper_validation::studies::program;
use serde_json::json;
use std::path::PathBuf;

/// Show finished, running, failed and missing items, and the state of the tasks in the queue
#[derive(Debug, Args)]
pub struct Status {
    /// Directory of the study
    pub directory: PathBuf,
    /// List every item with its hash instead
    #[arg(long)]
    pub items: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Status {
    pub fn run(&self) -> Result<(), Failure> {
        with_machine(|registry, _, _| {
            let fleet = Fleet::open(&self.directory, &program(registry))?;
            if self.items {
                if self.json {
                    return standard_output::print_json(&json!({ "items": fleet.study.items }));
                }
                let line = |item: &mapper_fleet::ItemEntry| format!("{}  {}\n", item.hash, item.name);
                return standard_output::print(&fleet.study.items.iter().map(line).collect::<String>());
            }
            let status = fleet.status();
            // The queue is queried only if items are unfinished, and with a time limit.
            let submission = fleet.submission().ok().filter(|_| status.unfinished() > 0);
            let states = submission.and_then(|sent| {
                query_task_states(&Template { name: sent.template, text: sent.template_text }, &sent.work)
            });
            if self.json {
                let left_s = status.left_s();
                return standard_output::print_json(
                    &json!({ "study": fleet.study.name, "status": status, "core_s_left": left_s, "queue": states }),
                );
            }
            standard_output::print(&status_text(&fleet.study.name, &status, states.as_ref()))
        })
    }
}
