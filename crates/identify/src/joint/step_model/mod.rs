//! Model of all steps for the joint fit: block means, smoothed inputs, efficiency surface, and predicted T2 readings.

pub(crate) mod gas_path;
pub(crate) mod history;
pub(crate) mod linearised;
pub(crate) mod parameters;
pub(crate) mod parts;
pub(crate) mod rows;
