//! The one place that names plug-ins.

use crate::exit_code::Code;
use crate::failure::Failure;
use mapper_backends::{replay, virtual_lab};
use mapper_campaign::Campaign;
use mapper_core::{Backend, BackendError};
use mapper_effects::ScriptEffect;
use mapper_physics::backend_plugin::BackendPlugin;
use mapper_physics::effect::Effect;
use mapper_physics::model::Model;
use mapper_physics::nominal_rig::NominalRig;
use std::path::PathBuf;
use std::sync::Arc;

/// What a backend is made from.
pub struct BackendContext<'a> {
    /// The campaign; its backend settings are the backend's alone to read.
    pub campaign: &'a Campaign,
    /// The nominal model.
    pub model: &'a Model,
}

/// Every backend, one line each.
pub const BACKENDS: &[BackendPlugin] = &[virtual_lab::PLUGIN, replay::PLUGIN];

/// The backend that a campaign asks for.
///
/// # Errors
/// [`BackendError::Settings`] where the name is unknown or the settings are wrong.
pub fn make_backend(context: &BackendContext<'_>) -> Result<Box<dyn Backend>, BackendError> {
    let campaign = context.campaign;
    let taps = campaign
        .sensors
        .iter()
        .filter_map(|(channel, sensor)| Some((*channel, sensor.static_tap_pipe_diameter_m?)));
    let nominal = NominalRig {
        model: context.model.clone(),
        boundary: campaign.boundary,
        speed_max_rpm: campaign.limits.speed_max_rpm,
        sensors: campaign.sensors.iter().map(|(channel, sensor)| (*channel, sensor.declared)).collect(),
        static_tap_pipe_diameters_m: taps.collect(),
        tolerances: campaign.tolerances,
        effects: effects(),
        seed: campaign.seed,
    };
    let wanted = &campaign.backend;
    BackendPlugin::make_by_name(BACKENDS, &wanted.name, &nominal, &wanted.settings)
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
