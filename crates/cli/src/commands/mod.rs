//! One file a command.

mod check;
mod gap;
mod gap_blind;
mod gap_diagnose;
mod gap_effects;
mod gap_page;
mod gap_text;
mod identify;
mod plan;
mod reproduce;
mod run;
mod schema;
mod scripted;

use crate::arguments::{Arguments, Command};
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
        Command::Reproduce(arguments) => reproduce::reproduce(arguments),
    }
}
