//! `mapper map reduce`: reduces a table of steady points to a map.

use crate::command_line::shared_arguments::MapReading;
use crate::output::failure::Failure;
use crate::output::standard_output::MapTarget;
use crate::{output::standard_output, registry};
use clap::Args;
use std::path::PathBuf;

/// Make a map from a table of steady points: corrected, with uncertainty by source, and without heat transfer if Tc or T3 was measured
#[derive(Debug, Args)]
pub struct Reduce {
    /// Table of N, flow, P1, T1, P2, T2, optionally Tc, T3, P3, P4, oil and humidity, or of a turbine (N, flow, P3, T3, P4, T4), in any layout of
    /// `mapper map inspect`
    pub points: PathBuf,
    #[command(flatten)]
    pub reading: MapReading,
    /// Campaign with sensors, machine and reference state, or run directory whose identified thermal model is used
    #[arg(long, value_name = "CAMPAIGN|RUN")]
    pub machine: Option<PathBuf>,
    /// Write the uncertainty budget of every point to this new file (CSV)
    #[arg(long, value_name = "FILE")]
    pub budget: Option<PathBuf>,
    /// Make the turbine's map from a table with points of both machines
    #[arg(long, conflicts_with = "budget")]
    pub turbine: bool,
    #[command(flatten)]
    pub target: MapTarget,
}

impl Reduce {
    pub fn run(&self) -> Result<(), Failure> {
        let (description, target) = (self.reading.description()?, &self.target);
        let budget = self.budget.as_deref().map(|file| (file, target.replace.existing()));
        let machine = self.machine.as_deref();
        let registry = registry::registry();
        let work = if self.turbine {
            registry.reduce_turbine_points(&self.points, &description, machine, target.map())?
        } else {
            registry.reduce_points(&self.points, &description, machine, target.map(), budget)?
        };
        standard_output::print_map_work(&work, target.json)
    }
}
