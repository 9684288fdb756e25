//! Upper bound on the sum of gradients of any order, by relaxation and assignment, to judge the planned order.

pub(crate) mod assignment;
pub(crate) mod bound;
pub(crate) mod relaxation;
