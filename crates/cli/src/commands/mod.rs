//! One file a command: its options, its call, its words. To add one, write its file and name it twice below.

mod check;
mod drift;
mod gap;
mod history;
mod identify;
mod map;
mod nightly;
mod plan;
mod reproduce;
mod run;
mod schema;

use crate::failure::Failure;
use crate::subcommands::subcommands;

subcommands! { Command:
    check::Check, schema::Schema, plan::Plan, run::Run, identify::Identify, gap::Gap, drift::Drift, nightly::Nightly,
    history::History, reproduce::Reproduce, map::Map,
}
