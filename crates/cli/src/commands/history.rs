//! `mapper history`: results of the nightly runs, and the catalogue of run folders.

use crate::output::failure::Failure;
use crate::output::standard_output::{self, FileOutput};
use clap::Args;
use mapper_history::{CatalogueFilter, Filter, Metric};
use mapper_report::{Describe, Document, history_svg, listed_runs, night_groups};
use mapper_session::{SessionError, index_runs, night_report_link};
use serde_json::json;
use std::path::PathBuf;

/// List, filter and plot the results of the nightly runs, and list the catalogued run folders
#[derive(Debug, Args)]
pub struct History {
    /// The history
    #[arg(long, value_name = "FILE", default_value = "runs/history.db")]
    pub db: PathBuf,
    /// Only this machine, or campaign
    #[arg(long, value_name = "NAME")]
    pub machine: Option<String>,
    /// Only this method
    #[arg(long, value_name = "METHOD")]
    pub method: Option<String>,
    /// Only nights since this day (UTC)
    #[arg(long, value_name = "YYYY-MM-DD", value_parser = parse_day)]
    pub since: Option<jiff::Timestamp>,
    /// Show this figure instead of the default ones; may be given more than once
    #[arg(long, value_name = "FIGURE", value_parser = parse_metric)]
    pub figure: Vec<Metric>,
    /// A row for each run, instead of the medians over the seeds
    #[arg(long)]
    pub runs: bool,
    /// First catalogue every run folder below this directory
    #[arg(long, value_name = "DIR")]
    pub index: Option<PathBuf>,
    /// Only catalogued runs with all of these words, and no nights
    #[arg(long, value_name = "WORDS")]
    pub find: Option<String>,
    /// Draw the trends into this new SVG file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    #[command(flatten)]
    pub output: FileOutput,
}

fn parse_metric(text: &str) -> Result<Metric, String> {
    Metric::find(text).ok_or_else(|| {
        let names: Vec<&str> = Metric::ALL.into_iter().map(Metric::name).collect();
        format!("there is no figure `{text}`; the figures are {}", names.join(", "))
    })
}

fn parse_day(text: &str) -> Result<jiff::Timestamp, String> {
    let day: jiff::civil::Date = text.parse().map_err(|error| format!("{error}; write e.g. 2026-11-21"))?;
    let midnight = day.to_zoned(jiff::tz::TimeZone::UTC).map_err(|error| error.to_string())?;
    Ok(midnight.timestamp())
}

/// Metrics that are shown by default.
const DEFAULT_METRICS: [Metric; 6] = [
    Metric::GoodPoints,
    Metric::EtaMean,
    Metric::EtaMedianError,
    Metric::EtaWorstError,
    Metric::HMean,
    Metric::HMedianError,
];

impl History {
    pub fn run(&self) -> Result<(), Failure> {
        let filter = Filter {
            machine: self.machine.clone(),
            method: self.method.clone(),
            since_ms: self.since.map(|since| since.as_millisecond()),
        };
        let open = if self.index.is_some() {
            mapper_history::History::open
        } else {
            mapper_history::History::open_existing
        };
        let mut history = open(&self.db).map_err(SessionError::from)?;
        if let Some(directory) = &self.index {
            for (folder, why) in index_runs(directory, &mut history)? {
                standard_output::say(&format!("{folder} cannot be read: {why}\n"));
            }
        }
        let wanted = CatalogueFilter {
            words: self.find.clone().unwrap_or_default(),
            machine: self.machine.clone(),
            ..CatalogueFilter::default()
        };
        let catalogue = history.catalogue(&wanted).map_err(SessionError::from)?;
        let runs = if self.find.is_some() { Ok(Vec::new()) } else { history.runs(&filter) };
        let runs = runs.map_err(SessionError::from)?;
        let figures: Vec<Metric> =
            if self.figure.is_empty() { DEFAULT_METRICS.to_vec() } else { self.figure.clone() };
        if let Some(path) = &self.svg {
            let report_of = |started_ms| night_report_link(path, &self.db, started_ms);
            self.output.write(path, history_svg(&runs, &figures, report_of).as_bytes())?;
        }
        if self.output.json {
            let runs: Vec<serde_json::Value> = runs.iter().map(mapper_report::listed_run_json).collect();
            return standard_output::print_json(&json!({
                "history": self.db, "runs": runs, "catalogue": catalogue.runs,
            }));
        }
        let mut document = match (runs.is_empty() && catalogue.all > 0, self.runs) {
            (true, _) => Document::default(),
            (_, true) => listed_runs(&runs, &figures),
            (_, false) => night_groups(&runs, &figures),
        };
        if catalogue.all > 0 {
            document.append(catalogue.document());
        }
        standard_output::show(&document)
    }
}
