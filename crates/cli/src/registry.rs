//! The one place that names plug-ins.

use mapper_backends::{replay, virtual_lab};
use mapper_campaign::Campaign;
use mapper_core::{Backend, BackendError};
use mapper_physics::effect::Effect;
use mapper_physics::model::Model;
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use std::path::Path;
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
