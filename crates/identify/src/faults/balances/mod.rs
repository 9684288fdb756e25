//! Physical relations that reveal sensor faults: head, housing heat, inlet temperature, valve flow, motion, efficiency, convection, conditions, and rest.

pub(crate) mod efficiency;
pub(crate) mod housing;
pub(crate) mod standstill;
pub(crate) mod valve;
