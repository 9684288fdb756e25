//! A recording compared with the model: gaps and their causes, drift, closure terms, logs without steps.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod closure;
pub mod drift;
pub mod driven;
pub mod gap;
