//! `mapper map correct`: a hot map without the heat that it shows.

use crate::command_line::shared_arguments::MapReading;
use crate::output::failure::Failure;
use crate::output::standard_output::MapTarget;
use crate::{output::standard_output, registry};
use clap::Args;
use std::path::PathBuf;

/// Take the heat off a hot map's apparent efficiencies, as far as the map alone shows it (after Sirakov and Casey)
#[derive(Debug, Args)]
pub struct Correct {
    /// Map, in any layout that `mapper map inspect` understands with apparent efficiencies
    pub map: PathBuf,
    #[command(flatten)]
    pub reading: MapReading,
    /// Heat to the gas at the reference state in W, instead of what the map shows
    #[arg(long, value_name = "W")]
    pub heat: Option<f64>,
    #[command(flatten)]
    pub target: MapTarget,
}

impl Correct {
    /// Corrects a map.
    pub fn run(&self) -> Result<(), Failure> {
        let given = self.reading.description()?;
        let work = registry::registry().correct_map_file(&self.map, &given, self.heat, self.target.map())?;
        standard_output::print_map_work(&work, self.target.json)
    }
}
