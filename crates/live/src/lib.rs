//! Shows a run while it is in progress: a web page with buttons for the operator, and a stream for Foxglove or Lichtblick.
//!
//! [`Observers`] receive the session's events. The page keeps a bounded state and serves browsers: the page itself, a stream of server-sent
//! events, and four requests for the operator's buttons. A browser that is slow, gone or hostile affects only its own connection, never the run.
//! `docs/decisions/0023-observers.md` gives the reasons for the server's design.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod connections;
mod feed;
#[cfg(feature = "foxglove")]
mod foxglove_stream;
mod live;
mod observers;
mod request;
mod server;
mod tls;

pub use feed::LiveRun;
#[cfg(feature = "foxglove")]
pub use foxglove_stream::{FoxgloveStream, FoxgloveStreamError, parse_local_address};
pub use live::LiveError;
pub use observers::{ObserverRequest, Observers};
pub use request::parse_address;
pub use tls::{TlsError, TlsFiles};
