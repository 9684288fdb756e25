//! Work in many independent pieces, on the cores of one machine or on many machines that share a directory.
//!
//! A study becomes items, each a small file named by the SHA-256 of its bytes. A worker writes one part file per item.
//! Parts merge into the result that one machine alone would write. All state is in the directory: no daemon, no
//! database, no clock. A [`Kind`] defines the items and the work; this crate contains no physics.
//! docs/how-to/fleet.md specifies the contract.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod cost;
mod engine;
mod error;
mod fleet;
mod hash;
mod item;
mod kind;
mod kinds;
mod made;
mod merge;
mod part;
mod place;
mod queue;
mod shard;
mod status;
mod study;
mod study_file;
mod submit;
mod work;

pub use cost::{Cost, Tried};
pub use engine::{Engine, cores};
pub use error::FleetError;
pub use fleet::Fleet;
pub use hash::Hash;
pub use item::Item;
pub use kind::{At, Draft, Drafts, Kind, Output, Results, WorkError};
pub use kinds::kind_of;
pub use made::Made;
pub use merge::Merged;
pub use part::{Outcome, Part, PartRefusal};
pub use place::Machine;
pub use queue::{Template, running};
pub use shard::Shard;
pub use status::{Lacking, Status};
pub use study::{Listed, Study};
pub use study_file::{StudyFile, StudyFileError, open_study};
pub use submit::{Limits, Submission, SubmitOptions};
pub use work::{Which, Worked};
