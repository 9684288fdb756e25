//! Checks whether the rig changed while a map was measured, and if so, which sensor or machine part changed, since when and how fast.
//!
//! The recorded boundary conditions drive the nominal model through all steps. Constants over the campaign explain part of the residual:
//! declared tolerances and offsets, and a deviation of each operating point that its repeats share. The most probable set of causes, each with
//! a time history ([`mapper_inference::hypotheses`]), explains the rest. Only repeats give evidence against the constants. docs/how-to/drift.md has
//! the method with its measured error rates.

mod blocks;
mod candidates;
mod cause;
mod conclude;
mod constant;
mod corrected;
mod decide;
mod diagnose;
mod drive;
mod fit;
mod knobs;
mod low_rank;
mod nuisance;
mod planted;
mod prediction;
mod readings;
mod refine;
mod repeats;
mod report;
mod request;
mod residuals;
mod segment;
mod subtract_drift;
mod time_history;
mod usable;
mod visits;

pub use cause::{Cause, CauseKind};
pub use diagnose::diagnose;
pub use report::{
    Alternative, CorrectedPoint, DetectionLimit, DriftReport, DriftVerdict, FoundDrift, RateOrStep,
    RepeatGroup, Visit, VisitChannel,
};
pub use request::{DriftError, DriftRequest, RecordedRun, Unsolvable};
pub use subtract_drift::without_drift;
pub use time_history::{Course, CourseKind};
