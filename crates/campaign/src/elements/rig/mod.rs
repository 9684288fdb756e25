//! Campaign keys that describe the gas stand: backend, sensors, boundary conditions, speed control, limits, and guards.

pub(crate) mod actuators;
pub(crate) mod backend;
pub(crate) mod calibration;
pub(crate) mod control;
pub(crate) mod guards;
pub(crate) mod limits;
pub(crate) mod redundant_sensors;
pub(crate) mod sensor_class;
pub(crate) mod sensors;
