//! `mapper gap`.

use super::{gap_blind, gap_diagnose, gap_effects};
use crate::failure::Failure;
use crate::gap_arguments::{BlindCommand, GapArguments, GapCommand};

/// Runs the sub-command that was asked for.
pub fn gap(arguments: &GapArguments) -> Result<(), Failure> {
    match &arguments.command {
        GapCommand::Diagnose(arguments) => gap_diagnose::diagnose(arguments),
        GapCommand::Blind(arguments) => match &arguments.command {
            BlindCommand::Make(arguments) => gap_blind::make(arguments),
            BlindCommand::Run(arguments) => gap_blind::run(arguments),
            BlindCommand::Score(arguments) => gap_blind::score(arguments),
            BlindCommand::Calibrate(arguments) => gap_blind::calibrate(arguments),
        },
        GapCommand::Effects(arguments) => gap_effects::effects(arguments),
    }
}
