//! The one place that names plug-ins.

use crate::exit_code::Code;
use crate::failure::Failure;
use mapper_backends::{replay, virtual_lab};
use mapper_campaign::Campaign;
use mapper_core::{Backend, BackendError};
use mapper_effects::ScriptEffect;
use mapper_physics::effect::Effect;
use mapper_physics::model::Model;
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a backend is made from.
pub struct BackendContext<'a> {
    /// The campaign; its backend settings are the backend's alone to read.
    pub campaign: &'a Campaign,
    /// The nominal model.
    pub model: &'a Model,
}

type MakeBackend = fn(&BackendContext<'_>) -> Result<Box<dyn Backend>, BackendError>;

/// Every backend: name in campaigns, one line for people, constructor.
pub const BACKENDS: &[(&str, &str, MakeBackend)] = &[
    (virtual_lab::NAME, "simulated gas stand, needs nothing", make_virtual_lab),
    (replay::NAME, "plays a recording back: {recording: FILE}", make_replay),
];

/// The backend that a campaign asks for.
///
/// # Errors
/// [`BackendError::Settings`] where the name is unknown or the settings are wrong.
pub fn make_backend(context: &BackendContext<'_>) -> Result<Box<dyn Backend>, BackendError> {
    let wanted = &context.campaign.backend.name;
    match BACKENDS.iter().find(|(name, ..)| name == wanted) {
        Some((_, _, make)) => make(context),
        None => {
            let known: Vec<&str> = BACKENDS.iter().map(|(name, ..)| *name).collect();
            Err(settings_error(
                wanted,
                "",
                format!("there is no such backend; there are {}", known.join(", ")),
            ))
        }
    }
}

/// Every effect of the catalogue.
pub fn effects() -> Vec<Arc<dyn Effect>> {
    mapper_effects::catalogue()
}

/// Every effect of the catalogue, and those that scripts define.
///
/// # Errors
/// A script that cannot be read, is no effect, or takes the name of another.
pub fn effects_with(scripts: &[PathBuf]) -> Result<Vec<Arc<dyn Effect>>, Failure> {
    let mut effects = effects();
    for path in scripts {
        let text = std::fs::read_to_string(path)
            .map_err(|error| Failure::new(Code::Failure, format!("{}: {error}", path.display())))?;
        let scripted = ScriptEffect::new(&text, path).map_err(|error| Failure::new(Code::BadInput, error))?;
        let id = &scripted.info().id;
        if effects.iter().any(|effect| effect.info().id == *id) {
            let message =
                format!("{}: there is an effect `{id}` already; choose another name", path.display());
            return Err(Failure::new(Code::BadInput, message));
        }
        effects.push(Arc::new(scripted));
    }
    Ok(effects)
}

fn make_virtual_lab(context: &BackendContext<'_>) -> Result<Box<dyn Backend>, BackendError> {
    let campaign = context.campaign;
    let nominal = virtual_lab::NominalRig {
        model: context.model.clone(),
        boundary: campaign.boundary,
        speed_max_rpm: campaign.limits.speed_max_rpm,
        sensors: campaign.sensors.iter().map(|(channel, sensor)| (*channel, sensor.declared)).collect(),
        static_tap_pipe_diameters_m: campaign
            .sensors
            .iter()
            .filter_map(|(channel, sensor)| Some((*channel, sensor.static_tap_pipe_diameter_m?)))
            .collect(),
        tolerances: campaign.tolerances,
        effects: effects(),
        seed: campaign.seed,
    };
    let settings = virtual_lab::read_settings(&campaign.backend.settings, nominal)?;
    Ok(Box::new(virtual_lab::VirtualLab::new(settings)))
}

fn make_replay(context: &BackendContext<'_>) -> Result<Box<dyn Backend>, BackendError> {
    let settings = &context.campaign.backend.settings;
    let Some(path) = settings.get("recording").and_then(|value| value.as_str()) else {
        let message = "write the path of an MCAP file, e.g. {recording: runs/x/recording.mcap}";
        return Err(settings_error(replay::NAME, "recording", message.to_owned()));
    };
    let report = read_recording(Path::new(path), &ChannelMap::native(), &ReadOptions::default())
        .map_err(|error| settings_error(replay::NAME, "recording", error.to_string()))?;
    Ok(Box::new(replay::ReplayBackend::new(&report.recording)))
}

fn settings_error(backend: &str, path: &str, message: String) -> BackendError {
    BackendError::Settings { backend: backend.to_owned(), path: path.to_owned(), message }
}
