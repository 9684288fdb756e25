//! The common part of every driver written in Rust. An author implements a [`Backend`] and calls [`About::serve`], or [`serve`] if users
//! never start the program by hand. This crate handles frames, hello, lease and the safe shutdown without a host, over pipes or a socket;
//! docs/reference/protocol.md describes the messages.
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     let about = mapper_driver::About {
//!         name: "my_rig",
//!         version: env!("CARGO_PKG_VERSION"),
//!         summary: "My rig.",
//!         settings: "its README",
//!     };
//!     about.serve(|settings| my_rig(settings))
//! }
//! # fn my_rig(_: &serde_json::Value) -> Result<Box<dyn mapper_core::Backend>, mapper_core::BackendError> { unimplemented!() }
//! ```
//!
//! A rig in real time is polled at its own rate, each time for the newest due sample; a simulated rig is polled when the host requests
//! it. A call that hangs prevents the safe shutdown, so every read or write of a backend needs its own deadline.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod about;
mod armed;
mod server;
mod serving;
mod settings;
#[cfg(unix)]
mod socket;

pub use about::{About, SOCKET};
pub use settings::{Outage, SecretError, address, by_channel, secret};
pub use socket::serve;
#[cfg(unix)]
pub use socket::serve_at;

use mapper_core::{Backend, BackendError};

/// Creates the rig from the driver's settings in the campaign, `null` if there are none, without touching it.
/// A driver at a socket makes one rig for each host that connects.
pub trait Open: Fn(&serde_json::Value) -> Result<Box<dyn Backend>, BackendError> {}

impl<F: Fn(&serde_json::Value) -> Result<Box<dyn Backend>, BackendError>> Open for F {}
