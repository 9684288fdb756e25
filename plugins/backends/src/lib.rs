//! Backends that come with `mapper`: one module each, registered in the cli's registry.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod replay;
mod setpoint_limits;
pub mod virtual_lab;
