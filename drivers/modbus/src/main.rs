//! `mapper-backend-modbus`: a gas stand behind a PLC or another controller that speaks Modbus TCP; docs/rig.md has its settings.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod blocks;
mod link;
mod registers;
mod rig;
mod settings;

fn main() -> std::process::ExitCode {
    mapper_driver::serve(settings::NAME, env!("CARGO_PKG_VERSION"), rig::open)
}
