//! Campaign keys for the results: output files, report, and display units.

pub(crate) mod display;
pub(crate) mod outputs;
pub(crate) mod report;
