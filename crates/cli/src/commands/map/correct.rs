//! `mapper map correct`: removes heat transfer from a map measured hot.

use crate::command_line::shared_arguments::MapReading;
use crate::output::failure::Failure;
use crate::output::standard_output::MapTarget;
use crate::{output::standard_output, registry};
use clap::Args;
use std::path::PathBuf;

/// Remove heat transfer from the apparent efficiencies of a map measured hot, using only the map (Sirakov and Casey)
#[derive(Debug, Args)]
pub struct Correct {
    /// Map, in any layout that `mapper map inspect` understands with apparent efficiencies
    pub map: PathBuf,
    #[command(flatten)]
    pub reading: MapReading,
    /// Heat flow to the gas at the reference state, W, instead of the estimate from the map
    #[arg(long, value_name = "W")]
    pub heat: Option<f64>,
    #[command(flatten)]
    pub target: MapTarget,
}

impl Correct {
    pub fn run(&self) -> Result<(), Failure> {
        let description = self.reading.description()?;
        let work =
            registry::registry().correct_map_file(&self.map, &description, self.heat, self.target.map())?;
        standard_output::print_map_work(&work, self.target.json)
    }
}
