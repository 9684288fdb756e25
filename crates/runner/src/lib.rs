//! Executes the steps of a plan, or of whatever yields steps, on any backend: setpoints, samples, guards, safe state.
//!
//! The runner knows nothing of identification or files: what it sees goes to a [`RunObserver`].

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod drift_watch;
mod guard;
mod observer;
mod run;
mod soak;
mod source;
mod speed_control;
mod surge_search;

pub use drift_watch::DriftWatch;
pub use guard::{Guard, LimitGuard, SilenceGuard, SurgeGuard, Trip};
pub use observer::{ObserverError, RunObserver};
pub use run::{RunEnd, RunError, Runner};
pub use soak::Soaked;
pub use source::{PlanSteps, StepSource, StepSourceError};
pub use speed_control::{ResponseAt, SpeedControl, SpeedControlLimits};
pub use surge_search::{Held, Hold, SurgeSearch};
