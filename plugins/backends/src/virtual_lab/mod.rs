//! A simulated gas stand: the lumped model, actuators, sensors, standstill, surge, overspeed.

mod campaign_keys;
mod lab;
mod name;
mod rig;
mod samples;
mod sensors;
mod settings;
mod truth;

pub use crate::virtual_lab::sensors::SecondOrder;
pub use crate::virtual_lab::sensors::SensorErrors;
pub use crate::virtual_lab::sensors::{LabElement, LabElements};
pub use campaign_keys::setting_problem::{SettingProblem, check_range};
pub use campaign_keys::settings_file::read_settings;
pub use lab::VirtualLab;
pub use name::NAME;
pub use rig::actuator::ActuatorDynamics;
pub use rig::boundary_wander::Weather;
pub use rig::drift::{DriftTarget, LabDrift};
pub use rig::running::LabInputs;
pub use rig::precursor::SurgePrecursor;
pub use rig::running::{RunningMachine, Structure, StructureError};
pub use rig::tolerances::draw_tolerances;
pub use settings::{LabSettings, Start};

use mapper_core::{Backend, BackendError};
use mapper_physics::rig::backend_plugin::BackendPlugin;
use mapper_physics::rig::backend_plugin::NominalRig;

/// The lab as a plugin for campaigns.
pub const PLUGIN: BackendPlugin =
    BackendPlugin { name: NAME, summary: "simulated gas stand, needs no hardware", make };

fn make(rig: &NominalRig, settings: &serde_json::Value) -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(VirtualLab::new(read_settings(settings, rig)?)))
}
