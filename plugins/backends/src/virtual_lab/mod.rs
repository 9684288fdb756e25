//! A gas stand that exists in equations only: the lumped model, actuators, sensors, standstill, surge, overspeed.

mod actuator;
mod drift;
mod drift_file;
mod effects_file;
mod inputs;
mod lab;
mod sensor;
mod settings;
mod settings_file;
mod tolerances;
mod truth;
mod weather;

pub use actuator::ActuatorDynamics;
pub use drift::{Drifting, LabDrift};
pub use lab::{NAME, VirtualLab};
pub use sensor::SensorErrors;
pub use settings::{LabSettings, Start};
pub use settings_file::{NominalRig, read_settings};
pub use tolerances::draw_tolerances;
pub use weather::Weather;
