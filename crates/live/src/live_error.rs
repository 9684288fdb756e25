//! Why there is no live page.

use crate::tls::TlsError;
use std::net::SocketAddr;

/// Why there is no live page.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// It is not an address.
    #[error("`{text}` is not an address; write e.g. 127.0.0.1:7373, or 0.0.0.0:7373 for other machines too")]
    Address {
        /// What was given.
        text: String,
    },
    /// The address is not to be had.
    #[error("the live page cannot be served at {address}: {source}; choose another with `--live=ADDRESS`")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// There is nothing to make a token from.
    #[error("the system gives no random numbers for a token: {0}")]
    Token(getrandom::Error),
    /// The page could not be made: a fault of the program.
    #[error("failed to write the live page: {0}")]
    Page(#[from] serde_json::Error),
    /// Certificate or key are of no use.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// There is no stream for viewers.
    #[cfg(feature = "foxglove")]
    #[error(transparent)]
    Viewers(#[from] crate::viewers::ViewersError),
}
