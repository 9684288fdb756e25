//! Campaign keys that describe the gas stand: backend, sensors, boundary conditions, speed control, limits, and guards.

pub(crate) mod backend;
pub(crate) mod boundary;
pub(crate) mod calibration;
pub(crate) mod guards;
pub(crate) mod limits;
pub(crate) mod readers;
pub(crate) mod redundant_sensors;
pub(crate) mod safe_state;
pub(crate) mod sensors;
pub(crate) mod speed_control;
