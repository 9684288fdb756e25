//! `mapper check`.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::{output, registry};
use clap::Args;
use mapper_campaign::CampaignError;
use mapper_report::{declared_sensors_text, duration};
use mapper_sequence::Script;
use mapper_session::{nominal_model, soak_s};
use serde_json::json;
use std::path::PathBuf;

/// Check a campaign file and print all its mistakes, each with its line and a remedy
#[derive(Debug, Args)]
pub struct Check {
    /// Campaign file (YAML)
    pub campaign: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Check {
    /// Checks a campaign and says in a line what it is.
    pub fn run(&self) -> Result<(), Failure> {
        let campaign = match mapper_campaign::load(&self.campaign) {
            Ok(campaign) => campaign,
            Err(CampaignError::Mistakes(findings)) if self.json => {
                let mistakes =
                    json!({"campaign": null, "findings": findings.list, "omitted": findings.omitted});
                output::print_json(&mistakes)?;
                return Err(Failure::told(Code::BadInput));
            }
            Err(error) => return Err(Failure::of_campaign(error)),
        };
        let model = nominal_model(&campaign)?;
        // The backend reads its settings now, so that a mistake in them does not wait for the night.
        let registry = registry::registry();
        registry
            .make_backend(&campaign, &model)
            .map(drop)
            .and_then(|()| registry.check_formats(&campaign))
            .map_err(|error| Failure::in_campaign(error, &self.campaign))?;
        if let Some(source) = &campaign.sequence {
            let script = Script { path: source.path.clone(), text: source.text.clone() };
            mapper_sequence::check(&script).map_err(|error| Failure::new(Code::BadInput, error))?;
        }
        let timing = &campaign.timing;
        let steps_s = campaign.points.len() as f64 * timing.dwell_s;
        let duration_s = soak_s(&campaign) + timing.warm_up_s + steps_s + timing.cool_down_s;
        if self.json {
            return output::print_json(&json!({
                "campaign": campaign.name,
                "points": campaign.points.len(),
                "minutes": duration_s / 60.0,
                "backend": campaign.backend.name,
                "findings": [],
                "omitted": 0,
            }));
        }
        let apart = match (&campaign.sequence, campaign.repeats) {
            (Some(_), _) => " if the script visits each once for as long as `timing.dwell`",
            (None, Some(_)) => ", repeats for drift not counted (`mapper plan` shows them)",
            (None, None) => "",
        };
        output::print(&format!(
            "{}: no mistakes. {} points on `{}` in {} of the rig's time{apart}.\n{}",
            self.campaign.display(),
            campaign.points.len(),
            campaign.backend.name,
            duration(duration_s),
            declared_sensors_text(&campaign),
        ))
    }
}
