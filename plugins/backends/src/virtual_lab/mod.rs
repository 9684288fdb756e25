//! A simulated gas stand: the lumped model, actuators, sensors, standstill, surge, overspeed.

mod actuator;
mod boundary_wander;
mod draws;
mod drift;
mod drift_file;
mod effects_file;
mod elements;
mod elements_file;
mod inputs;
mod lab;
mod name;
mod precursor;
mod running;
mod samples;
mod second_order;
mod sensor;
mod setting_problem;
mod settings;
mod settings_file;
mod tolerances;
mod truth;

pub use actuator::ActuatorDynamics;
pub use boundary_wander::Weather;
pub use drift::{Drifting, LabDrift};
pub use elements::{LabElement, LabElements};
pub use inputs::LabInputs;
pub use lab::VirtualLab;
pub use name::NAME;
pub use precursor::SurgePrecursor;
pub use running::{RunningMachine, Structure, StructureError};
pub use second_order::SecondOrder;
pub use sensor::SensorErrors;
pub use setting_problem::{SettingProblem, within};
pub use settings::{LabSettings, Start};
pub use settings_file::read_settings;
pub use tolerances::draw_tolerances;

use mapper_core::{Backend, BackendError};
use mapper_physics::backend_plugin::BackendPlugin;
use mapper_physics::nominal_rig::NominalRig;

/// The lab as a plugin for campaigns.
pub const PLUGIN: BackendPlugin =
    BackendPlugin { name: NAME, summary: "simulated gas stand, needs nothing", make };

fn make(rig: &NominalRig, settings: &serde_json::Value) -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(VirtualLab::new(read_settings(settings, rig)?)))
}
