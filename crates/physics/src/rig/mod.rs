//! The rig around the machine: effects, sensor faults, instruments, and the interface of simulated backends.

pub mod backend_plugin;
pub mod effect;
pub mod instruments;
pub mod sensor_fault;
