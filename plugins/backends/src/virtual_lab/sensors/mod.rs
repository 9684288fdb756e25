//! Simulated sensors of the virtual lab: offsets, noise, dynamic response, and redundant sensors with faults.

pub(crate) mod draws;
pub(crate) mod elements;
pub(crate) mod second_order;
pub(crate) mod sensor;
