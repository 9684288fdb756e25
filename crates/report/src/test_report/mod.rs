//! The test report of a run and its sections: key figures, conditions, instruments, zero, drift, surge and assumptions.

pub(crate) mod conditions;
pub(crate) mod key_figures;
pub(crate) mod run_report;
pub(crate) mod zero_and_sensors;
