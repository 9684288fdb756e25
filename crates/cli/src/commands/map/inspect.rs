//! `mapper map inspect`: shows how a map file is read.

use crate::command_line::shared_arguments::MapReading;
use crate::output::failure::Failure;
use crate::output::standard_output::Replace;
use crate::{output::standard_output, registry};
use clap::Args;
use std::path::PathBuf;

/// Show how a map file is read: columns, units, reference state, speed lines, and assumptions
#[derive(Debug, Args)]
pub struct Inspect {
    /// Map file
    pub map: PathBuf,
    #[command(flatten)]
    pub reading: MapReading,
    /// Write a map description, which later commands and campaigns accept, to this new file
    #[arg(long, value_name = "FILE")]
    pub write_description: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub replace: Replace,
}

impl Inspect {
    pub fn run(&self) -> Result<(), Failure> {
        let description = self.write_description.as_deref().map(|file| (file, self.replace.existing()));
        let work =
            registry::registry().inspect_map_file(&self.map, &self.reading.description()?, description)?;
        standard_output::print_map_work(&work, self.json)
    }
}
