//! Campaign keys for the evaluation of steps: identification method, window, settle bands, tolerances, and drift.

pub(crate) mod acceptance;
pub(crate) mod identification;
pub(crate) mod tolerances;
