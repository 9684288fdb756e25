//! Simulated rig of the virtual lab: machine, actuators, wandering test cell, drift, surge precursors, and tolerances.

pub(crate) mod actuator;
pub(crate) mod drift;
pub(crate) mod running;
