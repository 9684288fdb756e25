//! One file for each command, with its options and its output. To add a command, write its file and add a line below.

use crate::command_line::subcommands;
use crate::output::failure::Failure;

mod commission;

subcommands! { Command:
    init::Init,
    check::Check,
    schema::Schema,
    plan::Plan,
    run::Run,
    rig::Rig,
    backend::Backend,
    identify::Identify,
    report::Report,
    transient::Transient,
    log::Log,
    gap::Gap,
    drift::Drift,
    nightly::Nightly,
    history::History,
    studio::Studio,
    fleet::Fleet,
    reproduce::Reproduce,
    map::Map,
    completions::Completions,
    man::Man,
}
