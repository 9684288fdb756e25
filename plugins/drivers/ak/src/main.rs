//! `mapper-backend-ak`: measuring instruments that speak the AK protocol over TCP; docs/how-to/rig.md has its settings.

mod rig;
mod settings;

fn main() -> std::process::ExitCode {
    let about = mapper_driver::About {
        name: settings::NAME,
        version: env!("CARGO_PKG_VERSION"),
        summary: "Instruments of a test bed with the AK protocol over TCP; they are only read.",
        settings: r#"docs/how-to/rig.md, "Instruments next to the PLC""#,
    };
    about.serve(rig::open)
}
