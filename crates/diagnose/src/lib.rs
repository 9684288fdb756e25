//! A recording compared with the model: gaps and their causes, drift, missing terms, logs without steps.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod drift;
pub mod driven;
pub mod gap;
pub mod missing_terms;
