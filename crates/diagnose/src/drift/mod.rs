//! Checks whether the rig changed while a map was measured: which sensor or machine part, since when and how fast.
//!
//! The recorded boundary conditions drive the nominal model through all steps. Constants over the campaign explain part of the residual:
//! declared tolerances and offsets, and a deviation of each operating point that its repeats share. The most probable set of causes, each with
//! a time history ([`mapper_inference::hypotheses`]), explains the rest. Only repeats give evidence against the constants. docs/how-to/drift.md has
//! the method with its measured error rates.

mod candidates;
mod causes;
mod correction;
mod diagnose;
mod drive;
mod readings;
mod refinement;
mod report;
mod runs;

pub(crate) use causes::CauseKind;
pub use causes::{Cause, RATE_PER_H};
pub(crate) use correction::without_drift;
pub use diagnose::diagnose;
pub use report::{
    Alternative, CorrectedPoint, DriftReport, DriftVerdict, FoundDrift, RateOrStep, RepeatGroup,
};
pub use runs::{DriftError, DriftRequest, RecordedRun};
