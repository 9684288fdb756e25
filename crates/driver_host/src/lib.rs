//! Runs drivers: separate programs that control a rig. A [`Driver`] starts such a program, or connects to its socket, and implements the
//! interface [`Backend`](mapper_core::Backend) over the protocol of docs/reference/protocol.md, so that `session` uses it like a built-in
//! backend.
//!
//! A driver may hang, exit or send anything: every call has a timeout, every queue a limit, and every sample is checked. [`conformance`]
//! has the rules that every backend keeps.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod conformance;
mod driver;
mod find;
mod link;
pub mod protocol;
mod secrets;

pub use driver::{DEFAULT_TIMEOUTS, Driver, Timeouts};
pub use find::{DriverError, DriverLocation, Endpoint, INCLUDED_DRIVERS, PREFIX, SearchPath};
