//! `mapper map compare`: differences between two maps.

use crate::command_line::shared_arguments::MapReading;
use crate::output::failure::Failure;
use crate::output::standard_output::Replace;
use crate::{output::standard_output, registry};
use clap::Args;
use std::path::PathBuf;

/// Show where two maps differ, in absolute terms and relative to their uncertainty
#[derive(Debug, Args)]
pub struct Compare {
    /// Map to compare with
    pub first: PathBuf,
    /// Map to compare
    pub second: PathBuf,
    #[command(flatten)]
    pub reading: MapReading,
    /// Reference state of the second map, if its file does not give it
    #[arg(long, value_name = "STATE")]
    pub second_reference: Option<String>,
    /// Map description of the second map
    #[arg(long, value_name = "FILE")]
    pub second_description: Option<PathBuf>,
    /// Draw both maps and their difference in this new file (.svg or .png)
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub replace: Replace,
}

impl Compare {
    pub fn run(&self) -> Result<(), Failure> {
        let of_second = MapReading {
            reference: self.second_reference.clone(),
            description: self.second_description.clone(),
            ..MapReading::default()
        };
        let (first, second) = (self.reading.description()?, of_second.description()?);
        let picture = self.picture.as_deref().map(|path| (path, self.replace.existing()));
        let maps = [(self.first.as_path(), &first), (self.second.as_path(), &second)];
        let work = registry::registry().compare_map_files(maps, picture)?;
        standard_output::print_map_work(&work, self.json)
    }
}
