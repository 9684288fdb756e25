//! Runs of the blind test on the virtual lab, with recordings stored apart from their truth.

pub(crate) mod case_run;
pub(crate) mod destination;
pub(crate) mod steps;
