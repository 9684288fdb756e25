//! Selection of the effects that explain the gap, their probabilities, detection limits, and location in the machine.

pub(crate) mod additions;
pub(crate) mod place;
pub(crate) mod probabilities;
pub(crate) mod select;
