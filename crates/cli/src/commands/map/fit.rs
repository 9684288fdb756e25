//! `mapper map fit`: fits all speed lines together, and shows the error at lines left out of the fit.

use crate::command_line::shared_arguments::MapReading;
use crate::output::failure::Failure;
use crate::output::standard_output::MapTarget;
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
    /// Skip the error at lines that are left out
    #[arg(long)]
    pub no_leave_out: bool,
    #[command(flatten)]
    pub target: MapTarget,
}

impl Fit {
    pub fn run(&self) -> Result<(), Failure> {
        let options = MapFitOptions {
            further_speeds_rpm: self.speeds.clone(),
            nodes: usize::from(self.nodes),
            leave_one_out: !self.no_leave_out,
        };
        let description = self.reading.description()?;
        let work = registry::registry().fit_map_file(&self.map, &description, &options, self.target.map())?;
        standard_output::print_map_work(&work, self.target.json)
    }
}
