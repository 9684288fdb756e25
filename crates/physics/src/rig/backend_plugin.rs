//! The interface of simulated backends, and the nominal rig that they start from.

use crate::machine::params::BoundaryConditions;
use crate::rig::effect::Effect;
use crate::simulation::model::Model;
use mapper_core::{
    Backend, BackendError, Channel, DeclaredUncertainty, ModelTolerances, RedundantSensors, RigActuators,
    Soak,
};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// Reads a suspected effect from a file.
pub type ReadEffect = fn(&Path) -> Result<Arc<dyn Effect>, Box<dyn Error + Send + Sync>>;

/// Makes a backend from the declared rig and from its own settings, the value below `backend: {NAME: ...}` of a
/// campaign; `null` if the campaign gives none.
///
/// A mistake in the settings is [`BackendError::Settings`].
pub type MakeBackend = fn(&NominalRig, &serde_json::Value) -> Result<Box<dyn Backend>, BackendError>;

/// A backend that campaigns can name. Each backend has one, `PLUGIN`; the program lists them.
#[derive(Debug, Clone, Copy)]
pub struct BackendPlugin {
    /// Name in campaigns: lower case, digits and `_`.
    pub name: &'static str,
    /// A one-line description.
    pub summary: &'static str,
    /// Constructor.
    pub make: MakeBackend,
}

impl BackendPlugin {
    /// Makes the backend called `name` of a list from its settings.
    pub fn make_by_name(
        plugins: &[BackendPlugin],
        name: &str,
        rig: &NominalRig,
        settings: &serde_json::Value,
    ) -> Result<Box<dyn Backend>, BackendError> {
        match plugins.iter().find(|plugin| plugin.name == name) {
            Some(plugin) => (plugin.make)(rig, settings),
            None => {
                let known = plugins.iter().map(|plugin| plugin.name).collect::<Vec<_>>().join(", ");
                let source = Box::new(UnknownBackend { known });
                Err(BackendError::Settings { backend: name.to_owned(), path: String::new(), source })
            }
        }
    }
}

/// A campaign names an unknown backend.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown backend; the backends are {known}")]
pub struct UnknownBackend {
    /// Names of the known backends.
    pub known: String,
}

/// The machine and the rig as declared. A backend may differ from it according to its own settings.
#[derive(Debug, Clone)]
pub struct NominalRig {
    /// The machine as declared.
    pub model: Model,
    /// Boundary conditions as declared.
    pub boundary: BoundaryConditions,
    /// Motion of the actuators as declared.
    pub actuators: RigActuators,
    /// The campaign's speed limit, rpm.
    pub speed_max_rpm: f64,
    /// One-sigma uncertainty of each sensor, in the channel's unit, as declared or as identification assumes it.
    pub sensors: BTreeMap<Channel, DeclaredUncertainty>,
    /// Each sensor of the channels that have several; `sensors` has the combined values.
    pub redundant: BTreeMap<Channel, RedundantSensors>,
    /// Declared static taps with the inner diameters of their pipes, m.
    pub static_tap_pipe_diameters_m: BTreeMap<Channel, f64>,
    /// Declared tolerances of the model.
    pub tolerances: ModelTolerances,
    /// The declared soak before the run, if there is one.
    pub soak: Option<Soak>,
    /// Effects that may be added to a simulated machine by their ids.
    pub effects: Vec<Arc<dyn Effect>>,
    /// Reads further effects that a backend's settings name by their files.
    pub read_effect: ReadEffect,
    /// Seed of all noise and of all random draws.
    pub seed: u64,
}
