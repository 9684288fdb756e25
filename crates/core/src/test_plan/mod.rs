//! The plan that planner and runner exchange: operating points, jumps, their order and durations, and expected verdicts.

pub(crate) mod plan;
pub(crate) mod points;
pub mod step_number;
