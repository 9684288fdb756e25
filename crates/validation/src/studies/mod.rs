//! The kinds of studies that fleets work on: one file and one line each.

mod blind;
mod calibration;
mod maps;
mod nightly;
mod source;

use mapper_fleet::Kind;
use mapper_session::{Registry, program_and_commit};

pub use calibration::{CalibrationResult, fit_calibration};
pub use nightly::rows_of;

/// Name, version and commit of the program, which items and parts record.
pub fn program(registry: &Registry) -> String {
    program_and_commit(registry.commit)
}

/// All kinds, with the plug-ins that they may use.
pub fn kinds(registry: &Registry) -> Vec<Box<dyn Kind + '_>> {
    vec![
        Box::new(nightly::Nightly(registry)),
        Box::new(blind::Blind(registry)),
        Box::new(calibration::Calibration(registry)),
        Box::new(maps::Maps(registry)),
    ]
}
