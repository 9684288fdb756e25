//! Fast forecast of steps for the planner: each step begins with the housing temperatures that the previous one left.

pub mod chain;
pub(crate) mod forecast;
pub(crate) mod housing;
