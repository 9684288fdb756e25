//! Checks before the rig is armed, and the calibrations that a campaign needs on the day of its run.

use crate::SessionError;
use crate::plan::planning::nominal_model;
use mapper_campaign::campaign::{CalibrationRule, Date};
use mapper_campaign::{Campaign, CampaignError, Concern, forecast_calibration_warnings, mistakes, read_text};
use mapper_core::{CalibrationDefect, Plan, RigDescription, RigMode, Setpoints, Warning, step_number};
use mapper_physics::simulation::model::Model;
use mapper_report::Message;
use std::path::Path;

/// Recording size for one sample of one channel, bytes: measured on the virtual lab with truth, plus 50 %.
const BYTES_PER_VALUE: f64 = 40.0;
/// Additional free space required, bytes.
const SPARE_BYTES: f64 = 50e6;

pub(crate) fn check_setpoints(plan: &Plan, rig: &RigDescription) -> Result<(), SessionError> {
    let Some(accepts) = &rig.accepts else { return Ok(()) };
    for (place, step) in plan.steps.iter().enumerate() {
        let setpoints = Setpoints {
            mode: RigMode::Running,
            p3_pa: step.p3_pa,
            t3_k: step.t3_k,
            valve_opening_ratio: step.to.valve_opening_ratio,
            oil_temperature_k: step.oil_temperature_k,
        };
        accepts.check(&setpoints).map_err(|error| {
            SessionError::Preflight(format!("step {} of the plan: {error}", step_number(place)))
        })?;
    }
    Ok(())
}

/// Rejects a disk without room for the whole run. Rigs with simulated time are exempt, because their run can be repeated.
pub(crate) fn check_room(
    directory: &Path,
    duration_s: f64,
    rig: &RigDescription,
) -> Result<(), SessionError> {
    if rig.simulated_time {
        return Ok(());
    }
    let needed = duration_s * rig.sample_rate_hz * rig.channels.len() as f64 * BYTES_PER_VALUE + SPARE_BYTES;
    match free_bytes(directory) {
        Some(free) if free < needed => Err(SessionError::Preflight(format!(
            "the run needs {:.0} MB on the disk of {}, which has {:.0} MB left",
            needed / 1e6,
            directory.display(),
            free / 1e6
        ))),
        _ => Ok(()),
    }
}

#[cfg(unix)]
fn free_bytes(directory: &Path) -> Option<f64> {
    let file_system = rustix::fs::statvfs(directory).ok()?;
    Some(file_system.f_bavail as f64 * file_system.f_frsize as f64)
}

#[cfg(not(unix))]
fn free_bytes(_: &Path) -> Option<f64> {
    None
}

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
