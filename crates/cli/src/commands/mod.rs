//! One file a command.

mod check;
mod drift;
mod gap;
mod gap_blind;
mod gap_diagnose;
mod gap_drift;
mod gap_effects;
mod gap_page;
mod gap_text;
mod history;
mod identify;
mod map_compare;
mod map_convert;
mod map_fit;
mod map_rig;
mod nightly;
mod plan;
mod reproduce;
mod run;
mod schema;
mod scripted;

use crate::arguments::{Arguments, Command, MapCommand};
use crate::failure::Failure;

/// Runs the command that was asked for.
pub fn dispatch(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.command {
        Command::Check(arguments) => check::check(arguments),
        Command::Schema => schema::schema(),
        Command::Plan(arguments) => plan::plan(arguments),
        Command::Run(arguments) => run::run(arguments),
        Command::Identify(arguments) => identify::identify(arguments),
        Command::Gap(arguments) => gap::gap(arguments),
        Command::Drift(arguments) => drift::drift(arguments),
        Command::Nightly(arguments) => nightly::nightly(arguments),
        Command::History(arguments) => history::history(arguments),
        Command::Reproduce(arguments) => reproduce::reproduce(arguments),
        Command::Map(arguments) => match &arguments.command {
            MapCommand::Fit(arguments) => map_fit::fit(arguments),
            MapCommand::Convert(arguments) => map_convert::convert(arguments),
            MapCommand::Compare(arguments) => map_compare::compare(arguments),
            MapCommand::Rig(arguments) => map_rig::rig(arguments),
        },
    }
}
