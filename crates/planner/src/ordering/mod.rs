//! Search for the best order of the points under thermal memory, exact for few points and by annealing for many.

pub(crate) mod objective;
pub(crate) mod order;
pub(crate) mod search;
