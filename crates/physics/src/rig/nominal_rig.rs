//! The machine and the rig as declared in a campaign, for a backend; it contains no simulated truth.

use crate::machine::params::BoundaryConditions;
use crate::rig::effect::Effect;
use crate::simulation::model::Model;
use mapper_core::{Channel, DeclaredUncertainty, ModelTolerances, RedundantSensors, Soak};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The machine and the rig as declared. A backend may differ from it according to its own settings.
#[derive(Debug, Clone)]
pub struct NominalRig {
    /// The machine as declared.
    pub model: Model,
    /// Boundary conditions as declared.
    pub boundary: BoundaryConditions,
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
    /// Seed of all noise and of all random draws.
    pub seed: u64,
}
