//! What every driver needs: an author writes a [`Backend`] and calls [`serve`]; frames, hello, lease and the
//! safe trajectory when nobody is there any more are done here. docs/protocol.md says what goes over the pipes.
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     mapper_driver::serve("my_rig", env!("CARGO_PKG_VERSION"), |settings| my_rig(settings))
//! }
//! # fn my_rig(_: &serde_json::Value) -> Result<Box<dyn mapper_core::Backend>, mapper_core::BackendError> { unimplemented!() }
//! ```
//!
//! A rig in real time is polled here at its own rate, each time for the newest sample that is due; one in simulated time when the host
//! asks. A call that hangs keeps the rig from becoming safe: whatever a backend reads or writes needs a deadline of its own.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod armed;
mod descent;
mod outlet;
mod pipes;
mod refusal;
mod secret;
mod server;

pub use pipes::serve;
pub use secret::{SecretError, secret};

use mapper_core::{Backend, BackendError};

/// Makes the rig from the driver's settings in the campaign, `null` where there are none. The rig is not touched yet.
pub trait Open: FnOnce(&serde_json::Value) -> Result<Box<dyn Backend>, BackendError> {}

impl<F: FnOnce(&serde_json::Value) -> Result<Box<dyn Backend>, BackendError>> Open for F {}
