//! Runs a study of many independent items on the cores of one computer ([`Engine`]) or on many computers that share a directory
//! ([`Fleet`]).
//!
//! A study becomes items, each a small file named by the SHA-256 of its bytes. A worker writes one part file per item.
//! Parts merge into the result that one machine alone would write. All state is in the directory: no daemon, no
//! database, no clock. A [`Kind`] defines the items and the work; this crate contains no physics.
//! docs/how-to/fleet.md specifies the contract.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod files;
mod fleet;
mod status;
mod study;
mod submit;
mod work;

pub use files::{FleetError, Hash, Machine, StudyFileError};
pub use fleet::{
    CreatedStudy, Fleet, ItemDraft, Kind, Output, Results, StudyDraft, WorkContext, WorkError, kind_of,
};
pub use status::{MergeOutcome, Shard, Status, UnfinishedItem};
pub use study::{Item, ItemEntry, Study, StudyFile, open_study};
pub(crate) use study::{Outcome, Part};
pub use submit::{Limits, Submission, SubmitOptions, Template, number_ranges, query_task_states};
pub use work::{Cost, CostEstimate, Engine, ItemSelection, WorkOutcome, cores};
