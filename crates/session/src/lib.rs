//! The application as a library: plans and runs campaigns, identifies recordings, and writes maps and reports.
//!
//! For programs that offer these operations to users: the command line, the Python package, nightly runs and blind cases. Each creates a
//! [`Session`] with its plug-ins, an observer and stop flags. The library neither parses arguments nor prints. A complete campaign, from its
//! file to its map:
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
//! for point in results.identified.points_alone() {
//!     if let (Some(eta), Some(h_w_m2k)) = (point.eta, point.h_w_m2k) {
//!         println!("eta = {eta:.3}, h = {h_w_m2k:.0} W/(m2 K)");
//!     }
//! }
//! let map = results.compressor_map.ok_or("no map")?;
//! assert_eq!(map.lines.len(), 6, "one line for each speed of the grid");
//! # Ok(())
//! # }
//! ```

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod analysis;
mod errors;
mod event;
mod machine;
mod nights;
mod plan;
pub mod recording;
mod registry;
mod rig;
mod run;
mod session;
mod variant;

pub use analysis::calibrated_model_campaign::{CalibratedModel, calibrated_model_campaign};
pub use analysis::calibrated_model_files::{SealedForecast, found_in};
pub use analysis::drift::Drift;
pub use analysis::further_results::RigFiles;
pub use analysis::gap::Gap;
pub use analysis::gap_correction::GapCorrection;
pub use analysis::identification::Identified;
pub use analysis::pdf::{PrintError, page_as_pdf};
pub use analysis::results::{Results, compressor_map};
pub use analysis::transient::write_transient;
pub use errors::error::{ErrorKind, SessionError, since_text};
pub use errors::first_map_error::FirstMapError;
pub use errors::fmu_error::FmuExportError;
pub use errors::map_work_error::MapWorkError;
pub use event::{OnEvent, SessionEvent};
pub use machine::first_campaign::{FirstCampaign, first_campaign};
pub use machine::first_request::{FirstCampaignRequest, FirstRig};
pub use machine::fmu_file::WrittenFmu;
pub use machine::map_file::{map_description, write_map, write_map_fitted_if_needed};
pub use machine::map_work::{MapFile, MapOut, MapWork};
pub use mapper_diagnose::driven::Side;
pub use mapper_maps::table::DescriptionError;
pub use mapper_report::{result_remark_text, with_messages};
pub use mapper_runner::Operator;
pub use nights::night_report::{night_report_link, night_report_path, write_night_report};
pub use nights::nightly::PreparedNight;
pub use nights::nightly_run::NightlyRun;
pub use plan::calibration_check::load_on;
pub use plan::campaign_forecast::CampaignForecast;
pub use plan::planning::{PlanInputs, nominal_model, plan, plan_of};
pub use plan::rehearsal::{Rehearsal, rehearse};
pub use plan::stored_plan::stored_plan;
pub use recording::files::{DIAGNOSIS_FORMAT, Existing, Versioned, json_text, write_file, write_new};
pub use recording::identification_config::{declared, identification};
pub use recording::log_inspection::{LogInspection, inspect_log};
pub use recording::program::{PROGRAM, program_and_commit};
pub use recording::recording_file::{Recorded, channel_map, check_all_distinct};
pub use recording::resume::InterruptedRun;
pub use registry::{MakeDriver, ReadEffect, Registry};
pub use rig::drive::{Pace, drive, drive_paced, soak_s};
pub use rig::rig_state::{Lockout, Owner, RigStates, RigStatus, shared_state_directory};
pub use rig::sources::Sources;
pub use run::prepared_run::{PreparedRun, RunOutcome, RunRequest};
pub use run::recording_metadata::start_time_ns;
pub use run::run_end::RunTermination;
pub use run::run_stop::{Phase, RunStop, SignalResponse};
pub use session::Session;
pub use variant::{Variant, VariantError};

#[cfg(test)]
#[path = "../tests/common/shipped.rs"]
mod shipped;
