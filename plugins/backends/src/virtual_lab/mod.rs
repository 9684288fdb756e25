//! A simulated gas stand: the lumped model, actuators, sensors, standstill, surge, overspeed.

pub(crate) mod effects_file;
mod lab;
mod rig;
mod samples;
mod sensors;
pub(crate) mod settings_file;

pub use crate::virtual_lab::sensors::{LabElement, LabElements, SecondOrder, SensorErrors};
pub use effects_file::{NAME, SettingProblem, check_range};
pub use lab::VirtualLab;
pub use rig::actuator::ActuatorDynamics;
pub use rig::drift::{DriftTarget, LabDrift, Weather, draw_tolerances};
pub use rig::running::{LabInputs, RunningMachine, Structure, StructureError, SurgePrecursor};
pub use settings_file::{LabSettings, Start, read_settings};

use mapper_core::{Backend, BackendError};
use mapper_physics::rig::backend_plugin::{BackendPlugin, NominalRig};

/// The lab as a plugin for campaigns.
pub const PLUGIN: BackendPlugin =
    BackendPlugin { name: NAME, summary: "simulated gas stand, needs no hardware", make };

fn make(rig: &NominalRig, settings: &serde_json::Value) -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(VirtualLab::new(read_settings(settings, rig)?)))
}
