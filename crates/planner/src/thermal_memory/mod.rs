//! Forecast of steps for the planner: each step begins with the final housing temperatures of the previous one.

pub(crate) mod forecast;
pub mod housing;
