//! Errors of the live page.

use crate::web_server::tls::TlsError;
use std::net::SocketAddr;

/// Why the live page cannot be served.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum LiveError {
    #[error("the live page cannot be served at {0}: {1}; choose another address")]
    Listen(SocketAddr, #[source] std::io::Error),
    #[error("the system cannot generate random numbers for a token: {0}")]
    Token(getrandom::Error),
    /// A defect of the program.
    #[error("failed to write the live page: {0}")]
    Page(#[from] serde_json::Error),
    #[error(transparent)]
    Tls(#[from] TlsError),
    #[cfg(feature = "foxglove")]
    #[error(transparent)]
    Foxglove(#[from] crate::foxglove_stream::FoxgloveStreamError),
}
