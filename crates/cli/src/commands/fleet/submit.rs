//! `mapper fleet submit`: submits a study to a cluster.

use crate::fleet_directory::with_fleet;
use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_fleet::{Limits, SubmitOptions, Template};
use mapper_report::submission_text;
use std::path::PathBuf;

/// Submit the remaining items as an array job, followed by the merge, unless a limit is exceeded
#[derive(Debug, Args)]
pub struct Submit {
    /// Directory of the study
    pub directory: PathBuf,
    /// Submit to Slurm
    #[arg(long, required_unless_present = "template", conflicts_with = "template")]
    pub slurm: bool,
    /// Submit to another queue by this template (docs/how-to/fleet.md)
    #[arg(long, value_name = "FILE")]
    pub template: Option<PathBuf>,
    /// Partition, or queue [default: the site's own]
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    pub partition: String,
    /// Cores of a task, an item on each
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    pub cpus: u16,
    /// Target duration of a task, minutes
    #[arg(long, value_name = "MINUTES", default_value_t = 15.0, value_parser = parse_minutes)]
    pub task: f64,
    /// Limit: time of a task, whole minutes [default: twice the estimate plus 5 min]
    #[arg(long, value_name = "MINUTES", value_parser = clap::value_parser!(u64).range(1..))]
    pub time: Option<u64>,
    /// Limit: number of tasks of the array
    #[arg(long, value_name = "COUNT", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..))]
    pub array_limit: u64,
    /// Limit: number of tasks at once
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..))]
    pub at_once: Option<u64>,
    /// Limit: processor hours of all remaining items
    #[arg(long, value_name = "HOURS")]
    pub hours: Option<f64>,
    /// Limit: memory of a task, MB
    #[arg(long, value_name = "MB")]
    pub memory: Option<u64>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Submit {
    pub fn run(&self) -> Result<(), Failure> {
        let program = std::env::current_exe()
            .map_err(|error| Failure::new(Code::Failure, format!("failed to find this program: {error}")))?;
        let submission = with_fleet(&self.directory, None, |fleet, kind, engine, machine| {
            let options = SubmitOptions {
                template: self.template.as_deref().map_or_else(|| Ok(Template::slurm()), Template::read)?,
                program,
                partition: self.partition.clone(),
                cpus: self.cpus.into(),
                task_min: self.task,
                limits: Limits {
                    time_min: self.time,
                    tasks: self.array_limit,
                    at_once: self.at_once,
                    hours: self.hours,
                    memory_mb: self.memory,
                },
            };
            let cost = fleet.estimate_cost(kind, TRIAL_ITEMS, engine, machine)?.cost;
            fleet.submit(&options, &cost, machine)
        })?;
        if self.json {
            standard_output::print_json(&submission)
        } else {
            standard_output::print(&submission_text(&submission))
        }
    }
}

/// Number of finished items needed to estimate the cost of the others.
const TRIAL_ITEMS: usize = 3;

fn parse_minutes(text: &str) -> Result<f64, String> {
    let minutes: f64 = text.parse().map_err(|_| format!("`{text}` is not a number of minutes"))?;
    if minutes.is_finite() && minutes > 0.0 { Ok(minutes) } else { Err("it must be above 0".to_owned()) }
}
