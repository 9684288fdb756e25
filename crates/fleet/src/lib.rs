//! Runs a study of many independent items on the cores of one computer ([`Engine`]) or on many computers that share a directory
//! ([`Fleet`]).
//!
//! A study becomes items, each a small file named by the SHA-256 of its bytes. A worker writes one part file per item.
//! Parts merge into the result that one machine alone would write. All state is in the directory: no daemon, no
//! database, no clock. A [`Kind`] defines the items and the work; this crate contains no physics.
//! docs/how-to/fleet.md specifies the contract.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod directory;
mod merge;
mod status;
mod submit;
mod work;

pub use directory::files::Hash;
pub use directory::files::Machine;
pub use directory::files::{FleetError, StudyFileError};
pub use directory::fleet::CreatedStudy;
pub use directory::fleet::Fleet;
pub use directory::fleet::kind_of;
pub use directory::fleet::{ItemDraft, Kind, Output, Results, StudyDraft, WorkContext, WorkError};
pub(crate) use directory::part::{Outcome, Part};
pub use directory::study::Item;
pub use directory::study::{ItemEntry, Study};
pub use directory::study::{StudyFile, open_study};
pub use merge::MergeOutcome;
pub use status::Shard;
pub use status::{Status, UnfinishedItem};
pub use submit::{Limits, Submission, SubmitOptions, number_ranges};
pub use submit::{Template, query_task_states};
pub use work::{Cost, CostEstimate};
pub use work::{Engine, cores};
pub use work::{ItemSelection, WorkOutcome};
