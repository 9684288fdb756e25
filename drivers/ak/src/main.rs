//! `mapper-backend-ak`: instruments of a test bed that speak the AK telegram over TCP; docs/rig.md has its settings.

mod rig;
mod settings;

fn main() -> std::process::ExitCode {
    mapper_driver::serve(settings::NAME, env!("CARGO_PKG_VERSION"), rig::open)
}
