//! `mapper drift`: searches recordings for drift of the rig.

use crate::command_line::{channel_map, given_campaign};
use crate::environment::registry;
use crate::output::failure::{Code, Failure};
use crate::output::standard_output;
use crate::output::standard_output::Replace;
use clap::Args;
use mapper_campaign::Campaign;
use mapper_report::{Describe, corrected_csv};
use mapper_session::{DIAGNOSIS_FORMAT, Recorded, Session, SessionError, Versioned};
use serde_json::json;
use std::path::PathBuf;

/// Check whether the rig drifted while a map was made: which sensor, or the machine, since when and how fast
#[derive(Debug, Args)]
pub struct Drift {
    /// Run directories, MCAP files or logs in chronological order; with `--recording`, their campaign
    #[arg(required = true, value_name = "RECORDING|CAMPAIGN")]
    pub paths: Vec<PathBuf>,
    /// Recording, instead of by its place; may be given more than once
    #[arg(long, value_name = "FILE", conflicts_with = "campaign")]
    pub recording: Vec<PathBuf>,
    /// Channel map: where recordings made by another program hold the rig's channels (YAML)
    #[arg(long, value_name = "FILE")]
    pub channels: Option<PathBuf>,
    /// Campaign of the machine, if the recordings carry none
    #[arg(long, value_name = "FILE")]
    pub campaign: Option<PathBuf>,
    /// Write the points corrected for drift to this new CSV file
    #[arg(long, value_name = "FILE")]
    pub corrected: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub replace: Replace,
}

impl Drift {
    pub fn run(&self) -> Result<(), Failure> {
        let (files, given) = self.sources()?;
        let map = channel_map(self.channels.as_deref())?;
        let registry = registry();
        let read = |file: &PathBuf| Recorded::read_run(&registry, file, &map, given.as_ref());
        let runs = files.iter().map(read).collect::<Result<Vec<_>, SessionError>>()?;
        let recorded: Vec<Recorded> = runs.into_iter().flatten().collect();
        // clap requires at least one.
        let Some(first) = recorded.first() else { return Ok(()) };
        let campaign = first.require_campaign()?;
        let drift = Session::new(&registry).drift(&recorded, campaign, &map)?;
        if let Some(path) = &self.corrected {
            let corrected =
                corrected_csv(&drift.report).map_err(|error| Failure::new(Code::Failure, error))?;
            self.replace.write(path, &corrected)?;
        }
        let warnings: Vec<String> =
            recorded.iter().flat_map(|recorded| &recorded.read.warnings).map(ToString::to_string).collect();
        if self.json {
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

    /// Recordings, and the campaign if one is given.
    fn sources(&self) -> Result<(&[PathBuf], Option<Campaign>), Failure> {
        let named = !self.recording.is_empty();
        if named && self.paths.len() > 1 {
            let message = "`--recording` needs exactly one campaign, that of the recorded machine";
            return Err(Failure::new(Code::BadInput, message));
        }
        let (files, campaign) =
            if named { (&self.recording, self.paths.first()) } else { (&self.paths, self.campaign.as_ref()) };
        Ok((files, given_campaign(campaign.map(PathBuf::as_path))?))
    }
}
