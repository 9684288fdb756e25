//! Pages that the program serves: a run while it is in progress, with buttons for the operator, and the workbench ([`Studio`]).
//!
//! [`Live`] receives the session's events. The page keeps a bounded state and serves browsers: the page itself, a stream of server-sent
//! events, and four requests for the operator's buttons. A browser that is slow, gone or hostile affects only its own connection, never the run.
//! `docs/decisions/0023-observers.md` gives the reasons for the server's design.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod access;
mod feed;
mod live;
mod server;
mod studio;
mod tls;

pub use access::parse_address;
pub use feed::LiveRun;
pub use live::{Live, LiveError};
pub use studio::Studio;
pub use tls::{TlsError, TlsFiles};
