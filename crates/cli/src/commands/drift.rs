//! `mapper drift`: searches recordings for drift of the rig.

use crate::command_line::RecordingReading;
use crate::environment::registry;
use crate::output::failure::{Code, Failure};
use crate::output::standard_output::{self, FileOutput};
use clap::Args;
use mapper_report::{Describe, corrected_csv};
use mapper_session::{DIAGNOSIS_FORMAT, Recorded, Session, SessionError, Versioned};
use serde_json::json;
use std::path::PathBuf;

/// Check whether the rig drifted while a map was made: which sensor, or the machine, since when and how fast
#[derive(Debug, Args)]
pub struct Drift {
    /// Run directories, MCAP files or logs in chronological order
    #[arg(required = true)]
    pub recordings: Vec<PathBuf>,
    #[command(flatten)]
    pub reading: RecordingReading,
    /// Write the points corrected for drift to this new CSV file
    #[arg(long, value_name = "FILE")]
    pub corrected: Option<PathBuf>,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Drift {
    pub fn run(&self) -> Result<(), Failure> {
        let (map, given) = self.reading.read()?;
        let registry = registry();
        let read = |file: &PathBuf| Recorded::read_run(&registry, file, &map, given.as_ref());
        let runs = self.recordings.iter().map(read).collect::<Result<Vec<_>, SessionError>>()?;
        let recorded: Vec<Recorded> = runs.into_iter().flatten().collect();
        // clap requires at least one.
        let Some(first) = recorded.first() else { return Ok(()) };
        let campaign = first.require_campaign()?;
        let drift = Session::new(&registry).drift(&recorded, campaign, &map)?;
        if let Some(path) = &self.corrected {
            let corrected =
                corrected_csv(&drift.report).map_err(|error| Failure::new(Code::Failure, error))?;
            self.output.write(path, &corrected)?;
        }
        let warnings: Vec<String> =
            recorded.iter().flat_map(|recorded| &recorded.read.warnings).map(ToString::to_string).collect();
        if self.output.json {
            let versioned = Versioned { format_version: DIAGNOSIS_FORMAT, content: &drift.report };
            let mut value = serde_json::to_value(versioned).map_err(SessionError::from)?;
            value["recordings"] = recorded.iter().map(|recorded| json!(recorded.path)).collect();
            value["zero"] = json!(drift.zero);
            if !drift.sensors.is_empty() {
                value["sensors"] = json!(drift.sensors);
            }
            value["recording_warnings"] = json!(warnings);
            return standard_output::print_json(&value);
        }
        let mut document = drift.report.document();
        document.append(drift.sensors.document());
        document.append(drift.zero.document());
        warnings.iter().for_each(|warning| document.text(format!("recording: {warning}")));
        standard_output::show(&document)
    }
}
