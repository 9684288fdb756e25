//! `mapper map fit`: all speed lines together, with the error at lines that are left out.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::given::reference;
use crate::output::Replace;
use crate::{output, registry};
use clap::Args;
use mapper_assemble::{MapFitOptions, fit_map};
use mapper_report::map_fit_text;
use mapper_session::write_map;
use serde_json::json;
use std::path::PathBuf;

/// Fit all speed lines together and print the error at each line when it is left out
#[derive(Debug, Args)]
pub struct Fit {
    /// Map, or run directory
    pub map: PathBuf,
    /// Reference state of the file's corrected quantities, if the file does not give it: SAE, Garrett, BorgWarner or "T, P"
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
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
        let registry = registry::registry();
        let format = match &self.out {
            Some(path) => Some((path, registry.format_of(path, self.to.as_deref())?)),
            None => None,
        };
        let map = registry.read_map(&self.map, reference(self.reference.as_deref())?)?;
        let options = MapFitOptions {
            further_speeds_rpm: self.speeds.clone(),
            nodes: usize::from(self.nodes),
            leave_one_out: !self.no_leave_out,
        };
        let map = fit_map(map, &options)
            .map_err(|error| Failure::new(Code::BadInput, format!("{}: {error}", self.map.display())))?;
        if let Some((path, format)) = format {
            write_map(path, format, &map, self.replace.existing())?;
        }
        if self.json {
            return output::print_json(&json!({
                "map": self.map,
                "reference": map.reference,
                "fitted": map.fitted,
                "file": self.out,
            }));
        }
        let mut text = map.fitted.as_ref().map(|fitted| map_fit_text(&map, fitted)).unwrap_or_default();
        if let Some(path) = &self.out {
            text.push_str(&format!("map        {}\n", path.display()));
        }
        output::print(&text)
    }
}
