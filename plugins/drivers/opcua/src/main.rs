//! `mapper-backend-opcua`: a gas stand behind a PLC or another controller that speaks OPC UA; docs/how-to/rig.md has its settings.
//!
//! Without arguments, or with `--socket PATH`, it is a driver and speaks docs/reference/protocol.md; with `trust ENDPOINT` it pins a server's certificate.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod link;
mod login;
mod rig;
mod settings;
mod store;

use std::process::ExitCode;

fn main() -> ExitCode {
    if std::env::args_os().nth(1).is_some_and(|first| first != mapper_driver::SOCKET) {
        return rig::run();
    }
    let about = mapper_driver::About {
        name: settings::NAME,
        version: env!("CARGO_PKG_VERSION"),
        summary: "A gas stand behind a PLC or another controller that speaks OPC UA.",
        settings: r#"docs/how-to/rig.md, "Over OPC UA", has an example of all of them"#,
    };
    about.serve(rig::open)
}
