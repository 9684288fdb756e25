//! `mapper-backend-opcua`: a gas stand behind a PLC or another controller that speaks OPC UA; docs/rig.md has its settings.
//!
//! Without arguments it is a driver and speaks docs/protocol.md; with `trust ENDPOINT` it pins the certificate of a server.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod commands;
mod link;
mod rig;
mod settings;
mod store;
mod value;

use std::process::ExitCode;

fn main() -> ExitCode {
    if std::env::args_os().len() > 1 {
        return commands::run();
    }
    mapper_driver::serve(settings::NAME, env!("CARGO_PKG_VERSION"), rig::open)
}
