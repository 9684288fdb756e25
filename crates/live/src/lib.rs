//! The page of a run while it goes on.
//!
//! [`Live`] is told what the session tells, keeps a bounded state of it, and serves it to the browsers that look on: the page,
//! a stream of server-sent events, and four requests for the operator's buttons. A browser that is slow, gone or hostile costs
//! its own connection and never the run. `docs/decisions/0032-live-page.md` says why the server is what it is.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod access;
mod asked;
mod feed;
mod hub;
mod live;
mod live_run;
mod request;
mod server;
mod state;

pub use asked::Asked;
pub use live::{Live, LiveError};
pub use live_run::LiveRun;
