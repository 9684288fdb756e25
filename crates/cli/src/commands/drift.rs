//! `mapper drift`: whether the rig stayed the same while a map was made.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::given::channel_map;
use crate::output::Replace;
use crate::{output, registry};
use clap::Args;
use mapper_campaign::Campaign;
use mapper_report::{corrected_csv, drift_text, sensors_text, zero_text};
use mapper_session::{Recorded, Session, SessionError};
use serde_json::json;
use std::path::PathBuf;

/// Say whether the rig stayed the same while a map was made: which sensor drifts, or the machine, since when and how fast
#[derive(Debug, Args)]
pub struct Drift {
    /// Run directories in the order in which they were made; with `--recording`, the one campaign of the recordings
    #[arg(required = true, value_name = "RUN|CAMPAIGN")]
    pub paths: Vec<PathBuf>,
    /// MCAP recording, of this program or another; may be given more than once, in the order in which they were made
    #[arg(long, value_name = "FILE")]
    pub recording: Vec<PathBuf>,
    /// Channel map: where recordings made by another program hold the rig's channels (YAML)
    #[arg(long, value_name = "FILE", requires = "recording")]
    pub channels: Option<PathBuf>,
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
    /// Reads, judges, prints.
    pub fn run(&self) -> Result<(), Failure> {
        let (files, given) = self.sources()?;
        let map = channel_map(self.channels.as_deref())?;
        let registry = registry::registry();
        let recorded: Vec<Recorded> = files
            .iter()
            .map(|file| Recorded::read(&registry, file, &map, given.as_ref()))
            .collect::<Result<_, SessionError>>()?;
        let none = || Failure::new(Code::BadInput, "no recording was given");
        let first = recorded.first().ok_or_else(none)?;
        let campaign = first.known("Give it with `mapper drift --recording FILE CAMPAIGN`")?;
        let drift = Session::new(&registry).drift(&recorded, campaign, &map)?;
        if let Some(path) = &self.corrected {
            let corrected =
                corrected_csv(&drift.report).map_err(|error| Failure::new(Code::Failure, error))?;
            self.replace.write(path, &corrected)?;
        }
        let warnings = recorded.iter().flat_map(|recorded| &recorded.read.warnings);
        let warnings: Vec<String> = warnings.map(ToString::to_string).collect();
        if self.json {
            let mut value = serde_json::to_value(&drift.report).map_err(SessionError::from)?;
            let paths: Vec<&PathBuf> = recorded.iter().map(|recorded| &recorded.path).collect();
            value["recordings"] = json!(paths);
            value["zero"] = json!(drift.zero);
            if !drift.sensors.is_empty() {
                value["sensors"] = json!(drift.sensors);
            }
            value["recording_warnings"] = json!(warnings);
            return output::print_json(&value);
        }
        let mut text =
            [drift_text(&drift.report), sensors_text(&drift.sensors), zero_text(&drift.zero)].concat();
        text.extend(warnings.iter().map(|warning| format!("recording: {warning}\n")));
        output::print(&text)
    }

    /// Recordings, and the campaign where one is given.
    fn sources(&self) -> Result<(&[PathBuf], Option<Campaign>), Failure> {
        if self.recording.is_empty() {
            return Ok((&self.paths, None));
        }
        let [campaign] = self.paths.as_slice() else {
            let message = "`--recording` needs one campaign, that of the machine that was recorded";
            return Err(Failure::new(Code::BadInput, message));
        };
        let campaign = mapper_campaign::load(campaign).map_err(Failure::of_campaign)?;
        Ok((&self.recording, Some(campaign)))
    }
}
