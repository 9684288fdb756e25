//! The plan that planner and runner exchange: operating points, jumps, their order and durations, and expected verdicts.

pub(crate) mod jump;
pub(crate) mod operating_point;
pub(crate) mod plan;
pub(crate) mod plan_remark;
pub mod step_number;
pub(crate) mod timing;
pub(crate) mod verdict_forecast;
pub(crate) mod visit_order;
