//! A gas stand that exists in equations only: the lumped model, actuators, sensors, standstill, surge, overspeed.

mod actuator;
mod inputs;
mod lab;
mod sensor;
mod settings;
mod settings_file;
mod truth;

pub use actuator::ActuatorDynamics;
pub use lab::{NAME, VirtualLab};
pub use sensor::SensorErrors;
pub use settings::{LabSettings, Start};
pub use settings_file::{NominalRig, read_settings};
