//! Model of all steps for the joint fit: block means, smoothed inputs, efficiency surface, and predicted T2 readings.

pub(crate) mod model;
pub(crate) mod parameters;
pub(crate) mod rows;
pub(crate) mod smoothing;
pub(crate) mod surface;
