//! The settings of the driver, and the rig made from them.

use crate::rehearsal_rig::RehearsalRig;
use mapper_backends::BACKENDS;
use mapper_core::{Backend, BackendError};
use mapper_session::{Registry, nominal_model};
use serde::Deserialize;
use serde_json::Value;
use std::path::PathBuf;

/// Name of the driver.
pub(crate) const NAME: &str = "lab";

/// The settings below `lab` in a campaign.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    /// The campaign that defines machine, sensors and built-in backend.
    campaign: PathBuf,
    /// Whether the lab runs in wall time.
    #[serde(default)]
    real_time: bool,
    /// A file that gets a line for each command.
    command_log: Option<PathBuf>,
}

/// Why the lab cannot be created.
#[derive(Debug, thiserror::Error)]
enum LabError {
    #[error(
        "write {{campaign: FILE}}, a campaign whose machine the lab is; also: real_time: true, command_log: FILE. {0}"
    )]
    Form(serde_json::Error),
    #[error("{0}")]
    Campaign(String),
    #[error("failed to write {}: {source}", path.display())]
    CommandLog { path: PathBuf, source: std::io::Error },
}

/// The lab of a campaign.
pub(crate) fn open(settings: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let settings_error = |path: &str, error: LabError| BackendError::Settings {
        backend: NAME.to_owned(),
        path: path.to_owned(),
        source: Box::new(error),
    };
    let settings =
        Settings::deserialize(settings).map_err(|error| settings_error("", LabError::Form(error)))?;
    let of_campaign = |message: String| settings_error("campaign", LabError::Campaign(message));
    // A driver at a socket may run in another directory than the campaign, so the error shows the absolute path.
    let path = std::path::absolute(&settings.campaign).unwrap_or(settings.campaign);
    let campaign = mapper_campaign::load(&path).map_err(|error| of_campaign(error.to_string()))?;
    let registry =
        Registry { backends: BACKENDS.to_vec(), effects: mapper_effects::catalogue(), ..Registry::empty() };
    let model = nominal_model(&campaign).map_err(|error| of_campaign(error.to_string()))?;
    let lab = registry.make_backend(&campaign, &model).map_err(|error| of_campaign(error.to_string()))?;
    let log = settings.command_log.map(|path| {
        let error =
            |source| settings_error("command_log", LabError::CommandLog { path: path.clone(), source });
        std::fs::File::create(&path).map_err(error)
    });
    Ok(Box::new(RehearsalRig { lab, real_time: settings.real_time, log: log.transpose()?, now_s: 0.0 }))
}
