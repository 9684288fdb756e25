//! Whether the rig stayed the same while a map was made, and if not, what moved: which sensor, or the machine, since
//! when and how fast.
//!
//! The nominal model is driven by the recorded boundary conditions through all steps; what the readings differ from it
//! is explained by what is constant over the campaign (declared tolerances and offsets, and a deviation of each operating
//! point that its repeats share) and by the most probable set of causes, each with a course over time
//! ([`mapper_inference::hypotheses`]). Only what repeats show can count against the constants. docs/drift.md has the method with its measured error rates.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

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
