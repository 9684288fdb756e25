//! Drivers as backends: a program of its own, found by its name, behind the seam [`Backend`](mapper_core::Backend). No call
//! hangs and nothing grows without bound, whatever the driver sends; docs/protocol.md is what both sides keep to.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod driver;
mod error;
mod find;
mod known;
mod lease;
mod link;
mod pending;
mod secrets;

pub use driver::{Driver, PATIENCE, Patience};
pub use error::DriverError;
pub use find::{At, DriverLocation, PREFIX, Places};
pub use known::KNOWN;
