//! Orders the points of a campaign and says what each step is expected to give.
//!
//! The housing does not settle within a dwell, so what a jump yields depends on what came before: an order is judged by
//! going through it with the housing's memory, reduced to short sums while searching (`housing`), simulated in full for
//! the plan itself (`forecast`).

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod assignment;
mod auction;
mod bound;
mod candidates;
pub mod chain;
mod comparison;
mod exact;
mod figures;
mod fingerprint;
mod forecast;
mod graph;
mod housing;
mod method;
mod objective;
mod order;
mod plan;
mod plan_builder;
mod relaxation;
mod request;
mod search;
mod targets;
mod visits;
mod walk;

pub use comparison::other_orders;
pub use fingerprint::{made_from, sha256_hex};
pub use graph::{JumpForecast, Rejection, explain_jump, jump_graph};
pub use method::{ForecastRow, MethodResult, MethodResults, PredictedMethod};
pub use objective::Objective;
pub use plan::make_plan;
pub use plan_builder::max_steps;
pub use request::{PlanError, PlanRequest, UnreachablePoint};
pub use search::{Effort, search, search_worst};
pub use walk::STABLE_DRIFT_K_MIN;
