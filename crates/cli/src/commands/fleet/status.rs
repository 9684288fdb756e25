//! `mapper fleet status`: how far a study is.

use crate::fleet_place::on_this_machine;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_fleet::{Fleet, Template, running};
use mapper_report::status_text;
use mapper_validation::studies::program;
use serde_json::json;
use std::path::PathBuf;

/// Say what is done, under way, failed and missing, from the parts alone; the queue adds what it runs
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
    /// Looks.
    pub fn run(&self) -> Result<(), Failure> {
        on_this_machine(|registry, _, _| {
            let fleet = Fleet::open(&self.directory, &program(registry))?;
            if self.items {
                if self.json {
                    return standard_output::print_json(&json!({ "items": fleet.study.items }));
                }
                let line = |item: &mapper_fleet::Listed| format!("{}  {}\n", item.hash, item.name);
                return standard_output::print(&fleet.study.items.iter().map(line).collect::<String>());
            }
            let status = fleet.status();
            // Asked only if something may be under way, and never waited for.
            let submission = fleet.submission().ok().filter(|_| status.lacking() > 0);
            let states = submission.and_then(|sent| {
                running(&Template { name: sent.template, text: sent.template_text }, &sent.work)
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
