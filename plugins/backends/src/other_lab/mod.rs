//! A gas stand with different equations than the model, so that a diagnosis is not checked by the model that it assumes: a
//! housing of four nodes, a volume, a duct and another volume behind the wheel, a map with hysteresis, sensors of second
//! order. Actuators, weather, offsets, noise, standstill and trips are the virtual lab's.

mod equations;
mod machine;
mod motion;
mod passage;
mod settings_file;
mod structure;

pub use equations::turn_into;
pub use structure::{NAME, OtherStructure};

use crate::virtual_lab::VirtualLab;
use mapper_core::{Backend, BackendError};
use mapper_physics::rig::backend_plugin::BackendPlugin;
use mapper_physics::rig::nominal_rig::NominalRig;

/// The lab as a plugin for campaigns.
pub const PLUGIN: BackendPlugin =
    BackendPlugin { name: NAME, summary: "simulated gas stand of other equations, needs nothing", make };

fn make(rig: &NominalRig, settings: &serde_json::Value) -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(VirtualLab::new(settings_file::read(settings, rig)?)))
}
