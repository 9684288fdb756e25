//! Runs a study of many independent items on the cores of one computer ([`Engine`]) or on many computers that share a directory
//! ([`Fleet`]).
//!
//! A study becomes items, each a small file named by the SHA-256 of its bytes. A worker writes one part file per item.
//! Parts merge into the result that one machine alone would write. All state is in the directory: no daemon, no
//! database, no clock. A [`Kind`] defines the items and the work; this crate contains no physics.
//! docs/how-to/fleet.md specifies the contract.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod cost;
mod directory;
mod engine;
mod merge;
mod queue;
mod shard;
mod status;
mod submit;
mod work;

pub use cost::{Cost, CostEstimate};
pub use directory::error::FleetError;
pub use directory::fleet::Fleet;
pub use directory::hash::Hash;
pub use directory::item::Item;
pub use directory::kind::{ItemDraft, Kind, Output, Results, StudyDraft, WorkContext, WorkError};
pub use directory::kinds::kind_of;
pub(crate) use directory::part::{Outcome, Part};
pub use directory::shared_files::Machine;
pub use directory::study::{ItemEntry, Study};
pub use directory::study_file::{StudyFile, StudyFileError, open_study};
pub use directory::study_writer::CreatedStudy;
pub use engine::{Engine, cores};
pub use merge::MergeOutcome;
pub use queue::{Template, query_task_states};
pub use shard::Shard;
pub use status::{Status, UnfinishedItem};
pub use submit::{Limits, Submission, SubmitOptions};
pub use work::{ItemSelection, WorkOutcome};
