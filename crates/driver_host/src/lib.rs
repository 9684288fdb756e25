//! Drivers as backends: separate programs, found by name, behind the interface [`Backend`](mapper_core::Backend). Whatever the driver sends, all
//! calls have timeouts and all queues have limits. docs/reference/protocol.md defines the protocol.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod conformance;
mod driver;
mod error;
mod find;
mod known;
mod lease;
mod link;
mod pending;
pub mod protocol;
mod secrets;

pub use driver::{Driver, PATIENCE, Patience};
pub use error::DriverError;
pub use find::{At, DriverLocation, PREFIX, Places};
pub use known::KNOWN;
