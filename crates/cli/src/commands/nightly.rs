//! `mapper nightly`: runs full maps on the simulated rig and compares them with the nights before.

use crate::environment::registry;
use crate::interrupt;
use crate::output::failure::{Code, Failure};
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_campaign::load_nightly;
use mapper_history::{History, Night};
use mapper_report::night_comparison;
use mapper_session::{
    ErrorKind, PROGRAM, PreparedNight, Session, SessionError, night_report_path, night_runs,
    write_night_report,
};
use serde_json::json;
use std::path::PathBuf;

/// Run every map of a nightly campaign on the simulated rig and show changes since the last nights
#[derive(Debug, Args)]
pub struct Nightly {
    /// Nightly campaign (YAML): campaigns, methods, seeds
    pub nightly: PathBuf,
    /// History to compare with and append to, instead of the file's `history`
    #[arg(long, value_name = "FILE")]
    pub db: Option<PathBuf>,
    /// Accept the changes of tonight: start a new band with this night
    #[arg(long)]
    pub accept: bool,
    /// Take the runs from this merged study of `mapper fleet` instead of running them
    #[arg(long, value_name = "DIR", conflicts_with = "jobs")]
    pub fleet: Option<PathBuf>,
    /// Number of parallel runs [default: all cores]
    #[arg(long, value_name = "COUNT")]
    pub jobs: Option<usize>,
    /// End with one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Nightly {
    pub fn run(&self) -> Result<(), Failure> {
        let nightly = load_nightly(&self.nightly).map_err(SessionError::from)?;
        let prepared = PreparedNight::new(&nightly)?;
        // Opened before the runs, so that a history without write permission is reported at once.
        let path = self.db.clone().unwrap_or_else(|| nightly.history.clone());
        let mut history = History::open(&path).map_err(SessionError::from)?;
        let (registry, stop, progress) = (registry(), interrupt::stop_flag()?, output_options::progress());
        let on_event = |event: &_| progress.show(event);
        let session = Session { on_event: &on_event, stop: &stop, ..Session::new(&registry) };
        let started = jiff::Timestamp::now();
        let runs = match &self.fleet {
            Some(directory) => {
                let rows = mapper_validation::studies::rows_of(directory, &registry)?;
                prepared.check_rows(rows)
            }
            None => session.run_night(&prepared, self.jobs),
        };
        progress.clear();
        let runs = runs.map_err(|error| match error.kind() {
            ErrorKind::Interrupted => {
                Failure::new(Code::Interrupted, "stopped by the operator; nothing was added to the history")
            }
            _ => error.into(),
        })?;
        let mut night = Night {
            name: nightly.name.clone(),
            started_ms: started.as_millisecond(),
            duration_s: jiff::Timestamp::now().duration_since(started).as_secs_f64(),
            program: PROGRAM.to_owned(),
            accepted: self.accept,
            runs,
        };
        let comparison = match history.append(&mut night, nightly.nights) {
            Ok(comparison) => comparison,
            // The figures exist only here.
            Err(error) => {
                if self.json {
                    standard_output::print_json(&json!({"night": night}))?;
                } else {
                    standard_output::show(&night_runs(&night, false))?;
                }
                return Err(SessionError::from(error).into());
            }
        };
        if self.json {
            standard_output::print_json(&json!({
                "history": path,
                "report": night_report_path(&path, night.started_ms),
                "night": night,
                "comparison": comparison,
                "quiet": comparison.is_quiet(),
            }))?;
        } else {
            standard_output::show(&night_comparison(&night, &comparison, &path))?;
        }
        write_night_report(&path, &night, &comparison)?;
        if comparison.is_quiet() || (self.accept && comparison.failed.is_empty()) {
            return Ok(());
        }
        let message =
            "tonight differs from the nights before; if the change is intended, accept it with `--accept`";
        Err(if self.json { Failure::printed(Code::Moved) } else { Failure::new(Code::Moved, message) })
    }
}
