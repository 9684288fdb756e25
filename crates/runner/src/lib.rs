//! Executes the steps of a plan or of another step source on any backend: setpoints, samples, guards, safe state.
//!
//! The runner is independent of identification and files: it passes its data to a [`RunObserver`].

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod backends;
mod guards;
mod run_control;
mod step_sources;
pub mod surge;

pub use backends::auxiliary_instruments::{Reader, RigWithInstruments};
pub use backends::deadline::{Deadlined, Deadlines};
pub use guards::batch_watch::BatchWatch;
pub use guards::first_look::FirstLook;
pub use guards::guard::{Commanded, Guard, Trip};
pub use guards::plausibility_watch::{PlausibilityWatch, ReadingBounds};
pub use guards::reader_watch::{ReadChannel, ReaderWatch};
pub use guards::rig_watch::RigWatch;
pub use guards::signal_watch::SignalWatch;
pub use guards::surge_watch::SurgeWatch;
pub use run_control::observer::{ObserverError, RunObserver};
pub use run_control::operator::Operator;
pub use run_control::protection::Protection;
pub use run_control::run::{RunEnd, Runner};
pub use run_control::run_error::RunError;
pub use run_control::speed_control::{ResponseAt, SpeedControl, SpeedControlLimits};
pub use step_sources::drift_watch::DriftWatch;
pub use step_sources::soak::Soaked;
pub use step_sources::step_source::{PlanSteps, StepSource, StepSourceError};
pub use step_sources::surge_search::{Held, Hold, SurgeSearch};
