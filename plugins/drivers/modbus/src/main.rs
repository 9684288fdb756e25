//! `mapper-backend-modbus`: a gas stand behind a PLC or another controller that speaks Modbus TCP; docs/how-to/rig.md has its settings.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod link;
mod registers;
mod rig;
mod settings;

fn main() -> std::process::ExitCode {
    let about = mapper_driver::About {
        name: settings::NAME,
        version: env!("CARGO_PKG_VERSION"),
        summary: "A gas stand behind a PLC or another controller that speaks Modbus TCP.",
        settings: r#"docs/how-to/rig.md, "The campaign", has an example of all of them"#,
    };
    about.serve(rig::open)
}
