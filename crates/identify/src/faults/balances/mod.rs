//! Physical relations that reveal sensor faults: head, housing heat, inlet temperature, valve flow, efficiency, convection, conditions, and rest.

pub(crate) mod conditions;
pub(crate) mod convection;
pub(crate) mod efficiency;
pub(crate) mod head;
pub(crate) mod housing;
pub(crate) mod inlet;
pub(crate) mod standstill;
pub(crate) mod valve;
