//! Orders the points of a campaign and says what each step is expected to give.
//!
//! The housing does not settle within a dwell, so what a jump yields depends on what came before: every plan is
//! forecast by simulating the nominal machine along it.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod fingerprint;
mod forecast;
mod greedy;
mod plan;
mod request;

pub use fingerprint::sha256_hex;
pub use plan::make_plan;
pub use request::{
    PlanError, PlanLimits, PlanRequest, PlanTiming, SettleBands, UnreachablePoint, VisitOrder,
};
