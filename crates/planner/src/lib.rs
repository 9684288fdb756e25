//! Orders the points of a campaign and says what each step is expected to give.
//!
//! The housing does not settle within a dwell, so what a jump yields depends on what came before: an order is judged by
//! going through it with the housing's memory, reduced to short sums while searching (`housing`), simulated in full for
//! the plan itself (`forecast`).

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod jumps;
mod method;
mod ordering;
mod plans;
mod request;
mod targets;
pub mod thermal_memory;
mod upper_bound;

pub use jumps::graph::{JumpForecast, Rejection, explain_jump, jump_graph};
pub use jumps::walk::STABLE_DRIFT_K_MIN;
pub use method::{ForecastRow, MethodResult, MethodResults, PredictedMethod};
pub use ordering::objective::Objective;
pub use ordering::search::{Effort, search, search_worst};
pub use plans::comparison::other_orders;
pub use plans::fingerprint::{made_from, sha256_hex};
pub use plans::plan::make_plan;
pub use plans::plan_builder::max_steps;
pub use request::{PlanError, PlanRequest, UnreachablePoint};
