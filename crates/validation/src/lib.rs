//! Blind cases, calibration studies and the figures of the paper.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod blind;
pub mod reproduction;
pub mod studies;
