//! Executes a test on a rig: it sends setpoints, reads samples, checks every sample with guards, and always ends in the safe state.
//!
//! `session` builds a [`Runner`] from a step source ([`PlanSteps`] for a plan), a backend, a clock and guards. The runner is independent
//! of identification and files: it passes samples and events to a [`RunObserver`].

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod auxiliary_instruments;
mod deadline;
mod drift_watch;
mod guards;
mod run_control;
mod step_source;
pub mod surge;
mod surge_search;

pub use auxiliary_instruments::{AuxiliaryInstrument, RigWithInstruments};
pub use deadline::{DeadlineBackend, Deadlines};
pub use drift_watch::DriftWatch;
pub use guards::avoided_speed_watch::AvoidedSpeedWatch;
pub use guards::guard::{CommandedState, Guard, TripResponse, stop_is_due};
pub use guards::plausibility_watch::{PlausibilityWatch, ReadingBounds};
pub use guards::rig_watch::{BatchWatch, REQUIRED_CHANNELS, RigWatch, StartCheck};
pub use guards::signal_watch::{SignalWatch, SilenceWatch, UnguardedChannel};
pub use guards::surge_watch::SurgeWatch;
pub use run_control::observer::{ObserverError, Operator, Protection, RunError, RunObserver, stated_end};
pub use run_control::run::Runner;
pub use run_control::safe_shutdown::{AirStillOn, MAX_ATTEMPTS};
pub use run_control::speed_control::{ResponseAt, SpeedControl, SpeedControlLimits};
pub use run_control::transition_control::StandMotion;
pub use step_source::{PlanSteps, SoakSource, StepSource, StepSourceError};
pub use surge_search::{HoldConditions, HoldConditionsAt, SurgeSearch};
