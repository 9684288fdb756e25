//! Executes the steps of a plan or of another step source on any backend: setpoints, samples, guards, safe state.
//!
//! The runner is independent of identification and files: it passes its data to a [`RunObserver`].

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod surge;
mod auxiliary_instruments;
mod batch_watch;
mod deadline;
mod drift_watch;
mod first_look;
mod guard;
mod merge;
mod observer;
mod operator;
mod plausibility_watch;
mod protection;
mod reached;
mod reader_link;
mod reader_watch;
mod recent_extreme;
mod rig_watch;
mod run;
mod run_error;
mod safe_shutdown;
mod signal_watch;
mod soak;
mod source;
mod speed_control;
mod stopping;
mod surge_search;
mod surge_watch;

pub use auxiliary_instruments::{Reader, RigWithInstruments};
pub use batch_watch::BatchWatch;
pub use deadline::{Deadlined, Deadlines};
pub use drift_watch::DriftWatch;
pub use first_look::FirstLook;
pub use guard::{Commanded, Guard, Trip};
pub use observer::{ObserverError, RunObserver};
pub use operator::Operator;
pub use plausibility_watch::{PlausibilityWatch, ReadingBounds};
pub use protection::Protection;
pub use reader_watch::{ReadChannel, ReaderWatch};
pub use rig_watch::RigWatch;
pub use run::{RunEnd, Runner};
pub use run_error::RunError;
pub use signal_watch::SignalWatch;
pub use soak::Soaked;
pub use source::{PlanSteps, StepSource, StepSourceError};
pub use speed_control::{ResponseAt, SpeedControl, SpeedControlLimits};
pub use surge_search::{Held, Hold, SurgeSearch};
pub use surge_watch::SurgeWatch;
