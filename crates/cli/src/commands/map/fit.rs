//! `mapper map fit`: all speed lines together, with the error at lines that are left out.

use crate::output::failure::Failure;
use crate::command_line::shared_arguments::MapReading;
use crate::output::standard_output::Replace;
use crate::{output::standard_output, registry};
use clap::Args;
use mapper_maps::MapFitOptions;
use std::path::PathBuf;

/// Fit all speed lines together and print the error at each line when it is left out
#[derive(Debug, Args)]
pub struct Fit {
    /// Map in any layout of `mapper map inspect`, or run directory
    pub map: PathBuf,
    #[command(flatten)]
    pub reading: MapReading,
    /// Corrected speeds of additional lines, rpm, instead of two below and one above the measured ones
    #[arg(long, value_delimiter = ',', value_name = "RPM,...")]
    pub speeds: Option<Vec<f64>>,
    /// Nodes on each line
    #[arg(long, default_value_t = 41, value_parser = clap::value_parser!(u16).range(5..=400))]
    pub nodes: u16,
    /// Write the fitted map to this new file; its extension gives the format unless `--to` does
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Format of `--out`
    #[arg(long, value_name = "FORMAT", requires = "out")]
    pub to: Option<String>,
    /// Skip the error at lines that are left out
    #[arg(long)]
    pub no_leave_out: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub replace: Replace,
}

impl Fit {
    /// Fits a map.
    pub fn run(&self) -> Result<(), Failure> {
        let options = MapFitOptions {
            further_speeds_rpm: self.speeds.clone(),
            nodes: usize::from(self.nodes),
            leave_one_out: !self.no_leave_out,
        };
        let out = self.out.as_deref().map(|path| self.replace.map(path, self.to.as_deref()));
        let given = self.reading.description()?;
        let work = registry::registry().fit_map_file(&self.map, &given, &options, out)?;
        standard_output::print_map_work(&work, self.json)
    }
}
