//! `mapper gap predict`: makes a pre-registered forecast of the next recording, and compares it with that recording.

use crate::command_line::channel_map;
use crate::environment::registry;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_report::{Document, forecast_check};
use mapper_session::{DIAGNOSIS_FORMAT, Recorded, SealedForecast, Session, found_in};
use serde_json::json;
use std::path::PathBuf;

/// Forecast the next recording from a diagnosis and seal the forecast; with --recording, compare the two
#[derive(Debug, Args)]
pub struct Predict {
    /// Campaign of the next recording (YAML)
    pub campaign: PathBuf,
    /// Diagnosis, as `mapper gap diagnose --out` writes it; makes a forecast
    #[arg(long, value_name = "FILE", required_unless_present = "recording")]
    pub diagnosis: Option<PathBuf>,
    /// The forecast: a new file with --diagnosis, an existing one with --recording
    #[arg(long, value_name = "FILE")]
    pub forecast: PathBuf,
    /// Run directory, MCAP file, or log of another program that the forecast is compared with
    #[arg(long, value_name = "FILE", conflicts_with = "diagnosis")]
    pub recording: Option<PathBuf>,
    /// SHA-256 that was printed when the forecast was made; the file must have this hash
    #[arg(long, value_name = "HASH", requires = "recording")]
    pub seal: Option<String>,
    /// Channel map: where a recording made by another program holds the rig's channels (YAML)
    #[arg(long, value_name = "MAP")]
    pub channels: Option<PathBuf>,
    /// A suspected effect written in rhai that the diagnosis named; may be repeated
    #[arg(long = "effect", value_name = "FILE")]
    pub effects: Vec<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Predict {
    pub fn run(&self) -> Result<(), Failure> {
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let map = channel_map(self.channels.as_deref())?;
        let registry = registry();
        let effects = registry.effects_with(&self.effects)?;
        let session = Session::new(&registry);
        if let Some(diagnosis) = &self.diagnosis {
            let found = found_in(diagnosis)?;
            let steps = session.forecast_calibrated_model(&campaign, &map, effects, &found)?;
            let doubt = found.doubt.clone();
            let forecast = SealedForecast::new(campaign.name.clone(), found, steps);
            let (seal, steps) = (forecast.write(&self.forecast)?, forecast.steps.len());
            if self.json {
                return standard_output::print_json(
                    &json!({ "forecast": self.forecast, "steps": steps, "sha256": seal, "doubt": doubt }),
                );
            }
            let mut document = Document::default();
            document.text(format!("forecast of {steps} steps in {}", self.forecast.display()));
            document.text(format!("SHA-256: {seal}"));
            document.text(doubt.map(|doubt| format!("warning: {doubt}")).unwrap_or_default());
            return standard_output::show(&document);
        }
        // clap requires a recording if no diagnosis is given.
        let Some(recording) = &self.recording else { return Ok(()) };
        let (forecast, seal) = SealedForecast::read(&self.forecast, self.seal.as_deref())?;
        let recorded = Recorded::read(&registry, recording, &map, Some(&campaign))?;
        let check = session.check_forecast(&recorded, &campaign, &map, effects, &forecast.found)?;
        if self.json {
            return standard_output::print_json(&json!({
                "format_version": DIAGNOSIS_FORMAT, "sha256": seal, "check": check,
            }));
        }
        standard_output::show(&forecast_check(&check, &seal))
    }
}
