//! The diagnosis report for programs, recommended experiments, and effect sizes in engineering terms.

pub mod experiment;
pub(crate) mod in_words;
pub mod report;
pub mod warning;
