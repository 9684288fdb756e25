//! Calibrations that a campaign needs on the day of its run.

use crate::plan::planning::nominal_model;
use mapper_campaign::campaign::{CalibrationRule, Date};
use mapper_campaign::{Campaign, CampaignError, Concern, forecast_calibration_warnings, mistakes, read_text};
use mapper_core::{CalibrationDefect, Warning};
use mapper_physics::simulation::model::Model;
use mapper_report::Message;
use std::path::Path;

/// Concerns about the calibrations on the day of a run; errors if the campaign requires them.
pub(crate) fn calibration_concerns(campaign: &Campaign, model: &Model, day: Option<Date>) -> Vec<Concern> {
    let warnings = forecast_calibration_warnings(campaign, model, day).into_iter();
    let concern = warnings.map(|one| Concern {
        is_error: campaign.calibration == CalibrationRule::Required,
        message: one.warning.message(),
        remedy: remedy(&one.warning).to_owned(),
        at: one.at,
    });
    concern.collect()
}

/// Loads a campaign, with its text, for a run on a day: the calibrations that it requires are valid then.
///
/// # Errors
/// As [`mapper_campaign::load`].
pub fn load_on(path: &Path, day: Option<Date>) -> Result<(Campaign, String), CampaignError> {
    let campaign = mapper_campaign::load(path)?;
    let text = read_text(path).map_err(|source| CampaignError::Read { path: path.to_owned(), source })?;
    let mut concerns = Vec::new();
    // A checked campaign has a model.
    if campaign.calibration == CalibrationRule::Required
        && let Ok(model) = nominal_model(&campaign)
    {
        concerns = calibration_concerns(&campaign, &model, day);
    }
    if concerns.is_empty() {
        Ok((campaign, text))
    } else {
        Err(CampaignError::Mistakes(Box::new(mistakes(&text, path, concerns))))
    }
}

fn remedy(warning: &Warning) -> &'static str {
    match warning {
        Warning::Calibration { defect: CalibrationDefect::Missing { .. }, .. } => {
            "write it from the certificate, or leave out `calibration: required`"
        }
        Warning::Calibration { defect: CalibrationDefect::Uncertainty { .. }, .. } => {
            "declare at least half of the certificate's expanded uncertainty"
        }
        _ => "calibrate the sensor, then write the values of its new certificate",
    }
}
