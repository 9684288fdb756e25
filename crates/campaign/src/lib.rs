//! Reads campaign files: [`load`] returns a checked [`Campaign`], or all mistakes of the file, each with its place and remedy.
//!
//! The text is parsed to a tree with positions and checked against the JSON schema ([`json_schema`], also for editors) with units and
//! ranges, then for consistency (grid, limits, window, files). A text without mistakes is deserialised, and its points are checked for
//! reachability.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod actuator_lines;
pub mod campaign;
mod checking;
mod checks;
mod elements;
mod load;
mod machine_sizes;
mod nightly;
mod resolved;
mod si_values;
#[cfg(test)]
#[path = "../tests/inside/testing.rs"]
mod testing;

pub use crate::elements::turbocharger::machine::{NominalTableError, nominal_table};
pub use actuator_lines::{ActuatorValue, actuator_lines, with_actuators};
pub use campaign::Campaign;
pub use checks::map_misfit::{
    Concern, MapMisfit, UnreachablePoint, find_map_misfit, nominal_model, unreachable_points,
};
pub use checks::unusual_settings::{
    CalibrationWarning, USUAL_WHEEL_DIAMETERS_M, forecast_calibration_warnings,
};
pub use elements::rig::guards::DEFAULT_MAX_AGE_S;
pub use elements::rig::sensor_class::{default_contact_sigma_ratio, default_gain_sigma_ratio};
pub use load::{
    CampaignError, MAX_FILE_BYTES, MAX_MAP_BYTES, backend_mistake, check, check_with, format_mistake,
    json_schema, load, mistakes, read_named_file, read_text, warnings,
};
pub use machine_sizes::{AssumedSize, internal_area_sigma_ratio, similar_machine, similar_sizes};
pub use mapper_yaml::{Finding, FindingKind, Findings, units};
pub use nightly::{Nightly, NightlyError, NightlyGroup, load_nightly};
pub use resolved::{ResolvedLine, ResolvedPoint, resolved_lines};
