//! A simulated gas stand whose equations differ from the lumped model, to check a diagnosis with a machine that it does not
//! assume: a housing of four nodes, two volumes and a duct after the wheel, a map with hysteresis, second-order sensors. Actuators,
//! weather, offsets, noise, standstill and trips are those of the virtual lab.

mod machine;
mod motion;
mod settings_file;

pub use machine::{NAME, OtherStructure};
pub use motion::apply_structure;

use crate::virtual_lab::VirtualLab;
use mapper_core::{Backend, BackendError};
use mapper_physics::rig::backend_plugin::{BackendPlugin, NominalRig};

/// The lab as a plugin for campaigns.
pub const PLUGIN: BackendPlugin = BackendPlugin {
    name: NAME,
    summary: "simulated gas stand with other equations, needs no hardware",
    make,
};

fn make(rig: &NominalRig, settings: &serde_json::Value) -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(VirtualLab::new(settings_file::read(settings, rig)?)))
}
