//! Physical relations that reveal sensor faults: head, housing heat, inlet temperature, valve flow, efficiency, convection, and conditions.

pub(crate) mod conditions;
pub(crate) mod convection;
pub(crate) mod efficiency;
pub(crate) mod head;
pub(crate) mod housing;
pub(crate) mod inlet;
pub(crate) mod valve;
