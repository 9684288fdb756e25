//! Detection of the steps of a recording, from markers, from commands, or from jumps of the readings.

pub(crate) mod jump_steps;
pub(crate) mod steps;
