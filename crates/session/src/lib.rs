//! The application as a library: plans and runs campaigns, identifies recordings, and writes maps and reports.
//!
//! The crate `mapper` is its interface for users. Here each operation is a method of [`Session`], which has the plug-ins, an observer and the
//! stop flags of its caller. A run makes the plan ([`plan()`]), locks and arms the rig ([`Session::prepare`], [`PreparedRun::run`]), records
//! every sample with a journal, and keeps the rig safe whatever happens. [`Session::identify`] turns recordings into points for every
//! command: it fuses redundant sensors, subtracts the zero, identifies all steps together, and adds the truth of a simulated rig. Results are
//! points, map and report as data and as files in the run's directory. Diagnoses go the same way through [`Session::diagnose_gap`]. The library
//! neither parses arguments nor prints, and contains neither physics nor statistics.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod analysis;
mod errors;
mod machine;
mod nightly;
mod plan;
pub mod recording;
mod rig;
mod run;
mod session;

pub use crate::analysis::calibrated_model::{CalibratedModel, SealedForecast, calibrated_model_campaign};
pub use crate::errors::{
    ErrorKind, FirstMapError, FmuExportError, Input, MapWorkError, SessionError, StoredDiagnosisError,
    since_text,
};
pub use crate::machine::first_campaign::{FirstCampaignRequest, FirstRig};
pub use crate::nightly::{DrawnMachine, NightlyRun};
pub use crate::recording::files::{PROGRAM, program_and_commit};
pub use analysis::catalogue::{RunFolder, compare_runs, index_runs};
pub use analysis::diagnosis_file::{MadeFrom, diagnosis_of_run, found_in};
pub use analysis::drift::Drift;
pub use analysis::gap::Gap;
pub use analysis::identification::Identified;
pub use analysis::pdf::page_as_pdf;
pub use analysis::results::{Results, compressor_map};
pub use analysis::transient::write_transient;
pub use machine::first_campaign::first_campaign;
pub use machine::map_file::{map_description, write_map, write_map_fitted_if_needed};
pub use machine::map_work::{MapFile, MapOut, MapWork};
pub use mapper_diagnose::driven::Side;
pub use mapper_maps::table::DescriptionError;
pub use mapper_runner::Operator;
pub use nightly::{PreparedNight, night_report_link, night_report_path, night_runs, write_night_report};
pub use plan::planning::{PlanInputs, nominal_model, plan, plan_of, stored_plan};
pub use plan::rehearsal::{Rehearsal, rehearse};
pub use recording::export::{Converted, convert_recording};
pub use recording::files::{DIAGNOSIS_FORMAT, Existing, Versioned, json_text, write_file, write_new};
pub use recording::identification_config::{declared, identification};
pub use recording::recording_file::{Recorded, channel_map, check_all_distinct, inspect_log};
pub use recording::resume::InterruptedRun;
pub use rig::drive::{Pace, drive, soak_s};
pub use rig::rig_state::{RigStates, RigStatus, shared_state_directory};
pub use rig::sources::Sources;
pub use run::commissioning::Commissioning;
pub use run::preflight::load_on;
pub use run::prepared_run::{PreparedRun, RecordedRun, RunOutcome, RunRequest};
pub use run::run_stop::{Phase, RunStop, SignalResponse};
pub use session::{Registry, Session, SessionEvent};

#[cfg(test)]
#[path = "../tests/common/safety_model.rs"]
mod safety_model;
#[cfg(test)]
#[path = "../tests/common/shipped.rs"]
mod shipped;
