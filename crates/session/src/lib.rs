//! The application as a library: everything between arguments and words.
//!
//! A [`Session`] is opened with the plug-ins it may use, somebody who looks on, and a flag that stops it. The command line,
//! nightly runs, blind cases and any other program drive the same session.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod declared;
mod drift;
mod drive;
mod error;
mod event;
mod files;
mod gap;
mod guards;
mod identified;
mod map_file;
mod nightly;
mod nightly_row;
mod nightly_run;
mod observers;
mod planning;
mod predicted_method;
mod recorded;
mod registry;
mod rehearsal;
mod results;
mod rig_files;
mod run;
pub mod run_directory;
mod scripted_steps;
mod session;

pub use declared::identification;
pub use drift::Drift;
pub use drive::{drive, soak_s};
pub use error::{ErrorKind, SessionError};
pub use event::{OnEvent, SessionEvent};
pub use files::{json_text, write_new};
pub use gap::Gap;
pub use identified::Identified;
pub use map_file::{write_map, write_map_fitted_if_needed};
pub use nightly::PreparedNight;
pub use planning::{nominal_model, plan, stored_plan, with_plan_request};
pub use recorded::{Recorded, channel_map};
pub use registry::{ReadEffect, Registry};
pub use rehearsal::{Rehearsal, rehearse};
pub use results::Results;
pub use rig_files::RigFiles;
pub use run::{Ended, PROGRAM, PreparedRun, RunOutcome, RunRequest};
pub use session::Session;
