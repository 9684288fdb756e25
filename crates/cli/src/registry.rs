//! The one place that names plug-ins.

use mapper_backends::{replay, virtual_lab};
use mapper_core::{Backend, BackendError};
use mapper_effects::ScriptEffect;
use mapper_physics::effect::Effect;
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use mapper_session::{BackendContext, BackendPlugin, Registry, SessionError};
use std::path::Path;
use std::sync::Arc;

/// Every plug-in of this program.
pub fn registry() -> Registry {
    Registry {
        backends: vec![
            BackendPlugin {
                name: virtual_lab::NAME,
                summary: "simulated gas stand, needs nothing",
                make: make_virtual_lab,
            },
            BackendPlugin {
                name: replay::NAME,
                summary: "plays a recording back: {recording: FILE}",
                make: make_replay,
            },
        ],
        effects: mapper_effects::catalogue(),
        read_effect,
    }
}

fn read_effect(path: &Path) -> Result<Arc<dyn Effect>, SessionError> {
    let text = std::fs::read_to_string(path).map_err(|source| SessionError::File {
        action: "read",
        path: path.to_owned(),
        source,
    })?;
    let effect = ScriptEffect::new(&text, path).map_err(|error| SessionError::Effect(Box::new(error)))?;
    Ok(Arc::new(effect))
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
        effects: context.effects.to_vec(),
        seed: campaign.seed,
    };
    let settings = virtual_lab::read_settings(&campaign.backend.settings, nominal)?;
    Ok(Box::new(virtual_lab::VirtualLab::new(settings)))
}

fn make_replay(context: &BackendContext<'_>) -> Result<Box<dyn Backend>, BackendError> {
    let settings = &context.campaign.backend.settings;
    let Some(path) = settings.get("recording").and_then(|value| value.as_str()) else {
        let message = "write the path of an MCAP file, e.g. {recording: runs/x/recording.mcap}";
        return Err(settings_error(message.to_owned()));
    };
    let report = read_recording(Path::new(path), &ChannelMap::native(), &ReadOptions::default())
        .map_err(|error| settings_error(error.to_string()))?;
    Ok(Box::new(replay::ReplayBackend::new(&report.recording)))
}

fn settings_error(message: String) -> BackendError {
    BackendError::Settings { backend: replay::NAME.to_owned(), path: "recording".to_owned(), message }
}
