//! `mapper map convert`: a map in another format, at another reference state.

use crate::command_line::shared_arguments::{MapReading, reference};
use crate::output::failure::Failure;
use crate::output::standard_output::Replace;
use crate::{output::standard_output, registry};
use clap::Args;
use mapper_core::EfficiencyDefinition;
use std::path::PathBuf;

/// Write a map in another format, at another reference state
#[derive(Debug, Args)]
pub struct Convert {
    /// Map, in any layout that `mapper map inspect` understands
    pub map: PathBuf,
    /// New file; its extension gives the format unless `--to` does
    pub out: PathBuf,
    /// Format of the new file
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
    #[command(flatten)]
    pub reading: MapReading,
    /// Reference state of the new file [default: unchanged]
    #[arg(long, value_name = "STATE")]
    pub to_reference: Option<String>,
    /// Definition of the file's efficiencies, if the file does not name it: enthalpy, kappa_of_T1 or "constant_gamma 1.4"
    #[arg(long, value_name = "DEFINITION")]
    pub efficiency: Option<EfficiencyDefinition>,
    /// Definition of the efficiencies of the new file [default: unchanged]
    #[arg(long, value_name = "DEFINITION")]
    pub to_efficiency: Option<EfficiencyDefinition>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub replace: Replace,
}

impl Convert {
    pub fn run(&self) -> Result<(), Failure> {
        let to_reference = reference(self.to_reference.as_deref())?;
        let out = self.replace.map(&self.out, self.to.as_deref());
        let efficiencies = (self.efficiency, self.to_efficiency);
        let description = self.reading.description()?;
        let registry = registry::registry();
        let work = registry.convert_map_file(&self.map, &description, out, to_reference, efficiencies)?;
        standard_output::print_map_work(&work, self.json)
    }
}
