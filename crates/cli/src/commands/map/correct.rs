//! `mapper map correct`: a hot map without the heat that it shows.

use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::command_line::shared_arguments::MapReading;
use crate::output::standard_output::Replace;
use crate::{output::standard_output, registry};
use clap::Args;
use mapper_maps::correct_for_heat;
use mapper_report::heat_correction_text;
use mapper_session::write_map_fitted_if_needed;
use serde_json::json;
use std::path::PathBuf;

/// Take the heat off a hot map's apparent efficiencies, as far as the map alone shows it (after Sirakov and Casey)
#[derive(Debug, Args)]
pub struct Correct {
    /// Map, in any layout that `mapper map inspect` understands with apparent efficiencies
    pub map: PathBuf,
    /// New file; its extension gives the format unless `--to` does
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Format of `--out`
    #[arg(long, value_name = "FORMAT", requires = "out")]
    pub to: Option<String>,
    #[command(flatten)]
    pub reading: MapReading,
    /// Heat to the gas at the reference state in W, instead of what the map shows
    #[arg(long, value_name = "W")]
    pub heat: Option<f64>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub replace: Replace,
}

impl Correct {
    /// Corrects a map.
    pub fn run(&self) -> Result<(), Failure> {
        let registry = registry::registry();
        let format =
            self.out.as_ref().map(|path| registry.format_of(path, self.to.as_deref())).transpose()?;
        let map = registry.read_map(&self.map, &self.reading.description()?)?;
        let (map, correction) = correct_for_heat(map, self.heat)
            .map_err(|error| Failure::new(Code::BadInput, format!("{}: {error}", self.map.display())))?;
        if let Some((path, format)) = self.out.as_ref().zip(format) {
            write_map_fitted_if_needed(path, format, map, self.replace.existing())?;
        }
        if self.json {
            return standard_output::print_json(&json!({"map": self.map, "correction": correction, "file": self.out}));
        }
        let mut text = heat_correction_text(&correction);
        if let Some(path) = &self.out {
            text.push_str(&format!("map        {}\n", path.display()));
        }
        standard_output::print(&text)
    }
}
