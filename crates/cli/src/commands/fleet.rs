//! `mapper fleet`: studies of many items on many cores or computers.

use crate::command_line::subcommands;
use crate::environment::{with_fleet, with_machine};
use crate::output::failure::{Code, Failure};
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_fleet::{
    CreatedStudy, Hash, ItemSelection, Limits, MergeOutcome, Shard, SubmitOptions, Template, kind_of,
    open_study, query_task_states,
};
use mapper_report::{Describe, study_status};
use mapper_validation::studies::program;
use serde_json::json;
use std::path::PathBuf;

/// Run studies of many items on many cores or computers: maps, diagnoses, calibrations
#[derive(Debug, Args)]
pub struct Fleet {
    #[command(subcommand)]
    command: FleetCommand,
}

subcommands! { FleetCommand:
    Make,
    Estimate,
    Run,
    Work,
    Status,
    Merge,
    Submit,
    Retry,
}

impl Fleet {
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}

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
        standard_output::show_result(&tried.cost, self.json)
    }
}

/// Make the items of a study; in an existing study, items are added and removed and results are kept
#[derive(Debug, Args)]
pub struct Make {
    /// Study (YAML): its kind and the input of the kind
    pub study: PathBuf,
    /// Directory for items, parts and result
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Make {
    pub fn run(&self) -> Result<(), Failure> {
        with_machine(|registry, kinds, machine| {
            let study = open_study(&self.study).map_err(mapper_fleet::FleetError::from)?;
            let kind = kind_of(&study, kinds)?;
            let progress = output_options::progress();
            progress.begin("making items");
            let made = CreatedStudy::create(&study, kind, &self.out, &program(registry), machine.name);
            progress.clear();
            let made = made?;
            let items = made.fleet.study.items.len();
            if self.json {
                let (new, gone) = (made.new, made.gone);
                return standard_output::print_json(
                    &json!({ "directory": self.out, "items": items, "new": new, "gone": gone }),
                );
            }
            let changed = if made.new == items && made.gone == 0 {
                String::new()
            } else {
                format!(", {} of them new; {} were removed", made.new, made.gone)
            };
            standard_output::print(&format!(
                "{items} items in {dir}{changed}\nEstimate their cost: mapper fleet estimate {dir}\n",
                dir = self.out.display()
            ))
        })
    }
}

/// Merge all parts into the result that one computer would write; missing and failed items are listed
#[derive(Debug, Args)]
pub struct Merge {
    /// Directory of the study
    pub directory: PathBuf,
    /// Merge even if items are missing or failed
    #[arg(long)]
    pub partial: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Merge {
    pub fn run(&self) -> Result<(), Failure> {
        let merged = with_fleet(&self.directory, None, |fleet, kind, _, machine| {
            fleet.merge(kind, self.partial, machine)
        })?;
        let reason = "items are missing or failed; submit them again with `mapper fleet retry`, or run them here with `mapper fleet run --again`";
        print_merged(&merged, self.json, merged.status.unfinished() == 0, reason)
    }
}

/// Prints a merge; fails with `reason` if it is incomplete.
pub fn print_merged(
    merged: &MergeOutcome,
    json: bool,
    is_complete: bool,
    reason: &str,
) -> Result<(), Failure> {
    if json {
        let result = merged.result.as_ref().map(|(path, _)| path);
        standard_output::print_json(&json!({ "status": merged.status, "result": result }))?;
    } else {
        standard_output::show(&merged.document())?;
    }
    if is_complete {
        return Ok(());
    }
    Err(if json { Failure::printed(Code::Incomplete) } else { Failure::new(Code::Incomplete, reason) })
}

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
        standard_output::show_result(&submission, self.json)
    }
}

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
            let fleet = mapper_fleet::Fleet::open(&self.directory, &program(registry))?;
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
            standard_output::show(&study_status(&fleet.study.name, &status, states.as_ref()))
        })
    }
}

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
        standard_output::show_result(&submission, self.json)
    }
}

/// Number of finished items needed to estimate the cost of the others.
const TRIAL_ITEMS: usize = 3;

fn parse_minutes(text: &str) -> Result<f64, String> {
    let minutes: f64 = text.parse().map_err(|_| format!("`{text}` is not a number of minutes"))?;
    if minutes.is_finite() && minutes > 0.0 { Ok(minutes) } else { Err("it must be above 0".to_owned()) }
}

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
