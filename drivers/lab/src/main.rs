//! `mapper-backend-lab`: the virtual lab behind the protocol of drivers. It is the example of a driver in Rust, and with `real_time` a
//! rig to rehearse a night on: what was told to it stands in a file afterwards.

mod real_time;
mod settings;
mod told;

use settings::open;

fn main() -> std::process::ExitCode {
    mapper_driver::serve(settings::NAME, env!("CARGO_PKG_VERSION"), open)
}
