//! Measuring instruments that speak the AK protocol over TCP. The driver reads them and never controls them.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod telegram;
