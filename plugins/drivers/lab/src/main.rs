//! `mapper-backend-lab`: the virtual lab behind the driver protocol. It is the example of a driver in Rust. With `real_time` it also serves
//! to rehearse a run, and `command_log` names a file for the commands.

mod rehearsal_rig;

use rehearsal_rig::open;

fn main() -> std::process::ExitCode {
    let about = mapper_driver::About {
        name: rehearsal_rig::NAME,
        version: env!("CARGO_PKG_VERSION"),
        summary: "The virtual lab of another campaign behind the protocol of drivers, to rehearse on; an example of a driver.",
        settings: r#"campaign: FILE; also real_time: true, command_log: FILE (the commands that it receives). docs/reference/protocol.md has the protocol"#,
    };
    about.serve(open)
}
