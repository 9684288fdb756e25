//! Orders the points of a campaign and says what each step is expected to give.
//!
//! The housing does not settle within a dwell, so what a jump yields depends on what came before: an order is judged by
//! going through it with the housing's memory, reduced to short sums while searching (`housing`), simulated in full for
//! the plan itself (`forecast`).

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod assignment;
mod auction;
mod best;
mod bound;
mod candidates;
pub mod chain;
mod comparison;
mod dwell;
mod error_bound;
pub mod exact;
mod figures;
mod fingerprint;
mod finish;
mod forecast;
mod gradient_share;
mod graph;
mod housing;
mod method;
mod objective;
mod order;
mod plan;
mod reach;
mod repeats;
mod request;
mod rest;
mod retimed;
mod search;
mod simulations;
mod stage;
mod walk;

pub use best::{best, clearly_cheaper, cost_of_reaching};
pub use comparison::{Comparison, STABLE_DRIFT_K_MIN, WayOfMapping, along_speed_lines, compare};
pub use dwell::{REACHED_RATIO, SHORTEST_S, rested_dwell_s};
pub use error_bound::error_bound;
pub use fingerprint::sha256_hex;
pub use finish::without_share;
pub use graph::{JumpForecast, Rejection, explain_jump, jump_graph};
pub use method::{ErrorTangent, ForecastRow, MethodResult, PredictedMethod, WorthOfStep};
pub use objective::Objective;
pub use order::order_points;
pub use plan::make_plan;
pub use request::{PlanError, PlanRequest, UnreachablePoint};
pub use rest::{Now, Reordering, Walked, after_step, before_first_step, walk_on};
pub use retimed::{Retimed, forecast_longer, with_dwells};
pub use search::{Effort, search, search_worst};
pub use simulations::Simulations;
