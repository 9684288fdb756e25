//! Plans a test: orders the operating points of a campaign and predicts the result of each step.
//!
//! `session` and the command line fill a [`PlanRequest`]; [`make_plan`] turns it into a [`Plan`](mapper_core::Plan) with its steps and
//! expected errors.
//!
//! The housing does not settle within a dwell, so the temperature gradient of a step depends on the steps before it. The search
//! therefore predicts the housing temperatures after each step, with a reduced model of a few products (`housing`). The
//! chosen order is then simulated with the full model (`forecast`).

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub(crate) mod forecast;
pub mod housing;
mod jump_forecast;
mod jump_graph;
mod plan;
mod plan_builder;
mod request;
mod search;
mod visits;

pub use jump_forecast::{JumpForecast, explain_jump, forecast_all_jumps};
pub use jump_graph::{Rejection, SeparatePoints};
pub use plan::{make_plan, plan_other_orders};
pub use plan_builder::{STABLE_DRIFT_K_MIN, max_steps};
pub use request::{
    ForecastRow, MethodResult, MethodResults, PlanError, PlanRequest, PredictedMethod, UnreachablePoint,
    hash_inputs, sha256_hex,
};
pub use search::{Effort, search};
