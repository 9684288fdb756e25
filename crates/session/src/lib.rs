//! The application as a library, without argument parsing and text output.
//!
//! A [`Session`] gets its plug-ins, an observer and a stop flag from its creator. The command line, nightly runs, blind cases and any other
//! program use the same session. A complete campaign, from its file to its map:
//!
//! ```
//! use mapper_backends::virtual_lab;
//! use mapper_formats::FORMATS;
//! use mapper_session::{Registry, RunRequest, Session, SessionEvent};
//! use std::path::Path;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let registry =
//!     Registry { backends: vec![virtual_lab::PLUGIN], formats: FORMATS, ..Registry::default() };
//! let show = |event: &SessionEvent| {
//!     if let SessionEvent::StepStarted(step) = event {
//!         println!("step {} at {:.0} s", mapper_core::step_number(step.index), step.start_s);
//!     }
//! };
//! let session = Session { on_event: &show, ..Session::new(&registry) };
//! let file = Path::new("../../campaigns/grid18.yaml");
//! let (campaign, text) = (mapper_campaign::load(file)?, mapper_campaign::read_text(file)?);
//! let runs = tempfile::tempdir()?;
//! let results = session.run(RunRequest::new(&campaign, &text, runs.path()))?.results?;
//! for scored in results.points.iter().filter(|scored| scored.point.eta.is_some()) {
//!     println!("{:?} h = {:?} W/(m2 K)", scored.point.eta, scored.point.h_w_m2k);
//! }
//! let map = results.compressor_map.ok_or("no map")?;
//! assert_eq!(map.lines.len(), 6, "one line for each speed of the grid");
//! # Ok(())
//! # }
//! ```

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod budget_file;
mod declared;
mod drift;
mod drive;
mod error;
mod error_kind;
mod error_words;
mod estimates;
mod event;
mod experiments;
mod files;
mod first_campaign;
mod first_map;
mod first_map_error;
mod first_request;
mod fmu_binary;
mod fmu_error;
mod fmu_file;
mod fusing;
mod gap;
mod guards;
mod identified;
mod inspected;
mod journal;
mod map_file;
mod map_work;
mod map_work_error;
mod needed_dwell;
mod night_report;
mod nightly;
mod nightly_row;
mod nightly_run;
mod observers;
mod planning;
mod predicted_method;
mod preflight;
mod program;
mod prospects;
mod recorded;
mod recording_metadata;
mod registry;
mod rehearsal;
mod replayed;
mod results;
mod resume;
mod rig_files;
mod rig_lease;
mod rig_state;
mod run;
pub mod run_directory;
mod run_outcome;
mod run_stop;
mod scripted_steps;
mod session;
mod sources;
mod stored_plan;
mod surge;
mod threaded_observer;
mod transient;
mod twin_campaign;
mod twin_files;
mod variant;
mod verdict_forecast;
mod zero_forecast;

pub use declared::identification;
pub use drift::Drift;
pub use drive::{Pace, drive, drive_paced, soak_s};
pub use error::SessionError;
pub use error_kind::ErrorKind;
pub use event::{OnEvent, SessionEvent};
pub use files::{Existing, json_text, write_file, write_new};
pub use first_campaign::{FirstCampaign, first_campaign};
pub use first_map_error::FirstMapError;
pub use first_request::{FirstCampaignRequest, FirstRig};
pub use fmu_error::FmuExportError;
pub use fmu_file::WrittenFmu;
pub use gap::Gap;
pub use identified::{Identified, SoughtSurge};
pub use inspected::{Inspected, inspect_log};
pub use map_file::{map_description, write_map, write_map_fitted_if_needed};
pub use map_work::{MapFile, MapOut, MapWork};
pub use map_work_error::MapWorkError;
pub use mapper_diagnose::driven::why::Which;
pub use mapper_maps::table::DescriptionError;
pub use mapper_runner::Operator;
pub use night_report::{keep_night_report, night_report_link, night_report_path};
pub use nightly::PreparedNight;
pub use nightly_run::NightlyRun;
pub use planning::{PlanInputs, nominal_model, plan, plan_of};
pub use program::{PROGRAM, program_and_commit};
pub use prospects::Prospects;
pub use recorded::{Recorded, channel_map};
pub use recording_metadata::start_time_ns;
pub use registry::{MakeDriver, ReadEffect, Registry};
pub use rehearsal::{Rehearsal, rehearse};
pub use results::{Results, compressor_map};
pub use resume::BrokenOff;
pub use rig_files::RigFiles;
pub use rig_state::{Latch, Owner, RigStates, RigStatus, shared_state};
pub use run::{PreparedRun, RunOutcome, RunRequest};
pub use run_outcome::Ended;
pub use run_stop::{Phase, RunStop, Signalled};
pub use session::Session;
pub use sources::Sources;
pub use stored_plan::stored_plan;
pub use surge::{SurgeForecast, surge_forecast};
pub use transient::{Transient, write_transient};
pub use twin_campaign::{Twin, twin_campaign};
pub use twin_files::{SealedForecast, found_in};
pub use variant::{Variant, VariantError};

#[cfg(test)]
#[path = "../tests/common/shipped.rs"]
mod shipped;
