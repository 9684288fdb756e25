//! Plans a test: orders the operating points of a campaign and predicts the result of each step.
//!
//! `session` and the command line fill a [`PlanRequest`]; [`make_plan`] turns it into a [`Plan`](mapper_core::Plan) with its steps,
//! expected errors and an upper bound on the gradients of any other order.
//!
//! The housing does not settle within a dwell, so the temperature gradient of a step depends on the steps before it. The search
//! therefore predicts the housing temperatures after each step, with a reduced model of a few products (`housing`). The
//! chosen order is then simulated with the full model (`forecast`).

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod jumps;
mod ordering;
mod plans;
mod request;
pub mod thermal_memory;
mod upper_bound;

pub use jumps::jump_forecast::{JumpForecast, explain_jump, forecast_all_jumps};
pub use jumps::jump_graph::{Rejection, SeparatePoints};
pub use jumps::walk::STABLE_DRIFT_K_MIN;
pub use ordering::objective::Objective;
pub use ordering::search::{Effort, search, search_min_gradient};
pub use plans::plan::make_plan;
pub use plans::plan::plan_other_orders;
pub use plans::plan::{hash_inputs, sha256_hex};
pub use plans::plan_builder::max_steps;
pub use request::{ForecastRow, MethodResult, MethodResults, PredictedMethod};
pub use request::{PlanError, PlanRequest, UnreachablePoint};
