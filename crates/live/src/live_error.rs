//! Errors of the live page.

use crate::web_server::tls::TlsError;
use std::net::SocketAddr;

/// Why the live page cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The address is invalid.
    #[error(
        "`{0}` is not an address; write a port, e.g. 7373, or 127.0.0.1:7373, or 0.0.0.0:7373 for other machines too"
    )]
    Address(String),
    /// The address is not available.
    #[error("the live page cannot be served at {0}: {1}; choose another address")]
    Listen(SocketAddr, #[source] std::io::Error),
    /// The system has no random numbers for a token.
    #[error("the system cannot generate random numbers for a token: {0}")]
    Token(getrandom::Error),
    /// The page could not be created: a defect of the program.
    #[error("failed to write the live page: {0}")]
    Page(#[from] serde_json::Error),
    /// Certificate or key are unusable.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The Foxglove stream cannot be served.
    #[cfg(feature = "foxglove")]
    #[error(transparent)]
    Foxglove(#[from] crate::foxglove_stream::FoxgloveStreamError),
}
