//! The diagnosis report for programs, recommended experiments, and effect sizes in engineering terms.

pub(crate) mod experiment;
pub(crate) mod report;
