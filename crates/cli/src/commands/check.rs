//! `mapper check`.

use crate::environment::{registry, today};
use crate::interrupt;
use crate::output::failure::{Code, Failure};
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_campaign::CampaignError;
use mapper_campaign::campaign::Date;
use mapper_report::{CheckedCampaign, Describe, with_messages};
use mapper_session::{Session, nominal_model};
use serde_json::json;
use std::path::PathBuf;

/// Check a campaign file and print all its mistakes, each with its line and a remedy
#[derive(Debug, Args)]
pub struct Check {
    /// Campaign file (YAML)
    pub campaign: PathBuf,
    /// Day of the run, on which calibrations must be valid; today if it is left out
    #[arg(long, value_name = "DATE")]
    pub date: Option<Date>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Check {
    /// Checks a campaign, makes its plan or rehearses its script, and prints a summary after any warnings.
    pub fn run(&self) -> Result<(), Failure> {
        let day = self.date.or_else(today);
        let (campaign, text) = match mapper_session::load_on(&self.campaign, day) {
            Ok(loaded) => loaded,
            Err(CampaignError::Mistakes(findings)) if self.json => {
                let omitted = findings.omitted;
                let mut mistakes = Failure::of_campaign(CampaignError::Mistakes(findings)).json();
                (mistakes["campaign"], mistakes["omitted"]) = (json!(null), json!(omitted));
                standard_output::print_json(&mistakes)?;
                return Err(Failure::printed(Code::BadInput));
            }
            Err(error) => return Err(Failure::of_campaign(error)),
        };
        let model = nominal_model(&campaign)?;
        // The backend reads its settings now, so that mistakes in them are reported before the run.
        let registry = registry();
        registry
            .make_sources(&campaign, &model)
            .map(drop)
            .and_then(|()| registry.check_formats(&campaign))
            .map_err(|error| Failure::in_campaign(error, &self.campaign))?;
        let stop = interrupt::stop_flag()?;
        let session = Session { stop: &stop, ..Session::new(&registry) };
        let forecast = session.forecast_campaign(&campaign, &model, day)?;
        let warnings = mapper_campaign::warnings(&text, &self.campaign, &campaign, forecast.concerns);
        let lines = mapper_campaign::resolved_lines(&campaign, &model);
        if self.json {
            return standard_output::print_json(&json!({
                "campaign": campaign.name,
                "points": campaign.points.len(),
                "lines": lines,
                "assumed": campaign.machine.assumed,
                "steps": forecast.steps,
                "minutes": forecast.duration_s / 60.0,
                "backend": campaign.backend.name,
                "expected": forecast.verdicts,
                "advice": forecast.advice,
                "avoided": with_messages(|| json!(forecast.avoided)),
                "findings": [],
                "omitted": 0,
                "warnings": warnings.list,
            }));
        }
        if warnings.count() > 0 {
            standard_output::say(&warnings.render(output_options::is_stderr_coloured()));
        }
        standard_output::show(
            &CheckedCampaign {
                file: &self.campaign,
                campaign: &campaign,
                steps: forecast.steps,
                is_planned: forecast.is_planned,
                duration_s: forecast.duration_s,
                warnings: warnings.count(),
                verdicts: forecast.verdicts,
                advice: &forecast.advice,
                avoided: forecast.avoided.as_ref(),
                lines: &lines,
            }
            .document(),
        )
    }
}
