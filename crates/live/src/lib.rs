//! Shows a run while it is in progress: a web page with buttons for the operator.
//!
//! [`Live`] receives the session's events. The page keeps a bounded state and serves browsers: the page itself, a stream of server-sent
//! events, and four requests for the operator's buttons. A browser that is slow, gone or hostile affects only its own connection, never the run.
//! `docs/decisions/0023-observers.md` gives the reasons for the server's design.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod feed;
mod live;
mod request;
mod server;
mod tls;

pub use feed::LiveRun;
pub use live::{Live, LiveError};
pub use request::parse_address;
pub use tls::{TlsError, TlsFiles};
