//! The web server of the live page: connections, requests of untrusted clients, access control, TLS, and browser queues.

pub(crate) mod connections;
pub(crate) mod request;
pub(crate) mod server;
pub(crate) mod tls;
