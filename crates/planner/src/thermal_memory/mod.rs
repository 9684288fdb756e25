//! Forecast of steps for the planner: each step begins with the final housing temperatures of the previous one.

pub mod chain;
pub(crate) mod forecast;
pub(crate) mod housing;
