//! Instruments of a test bed that speak the AK telegram over TCP: read, never controlled.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod telegram;
