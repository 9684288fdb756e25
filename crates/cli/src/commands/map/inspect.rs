//! `mapper map inspect`: how a map file is understood.

use crate::failure::Failure;
use crate::given::reference;
use crate::{output, registry};
use clap::Args;
use mapper_report::imported_map_text;
use serde_json::json;
use std::path::PathBuf;

/// Show how a map file is understood: columns, units, reference state, speed lines, and what is assumed
#[derive(Debug, Args)]
pub struct Inspect {
    /// Map file
    pub map: PathBuf,
    /// Reference state of the file's corrected quantities, if the file does not give it: SAE, Garrett, BorgWarner or "T, P"
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Inspect {
    /// Reads a map and prints what was understood.
    pub fn run(&self) -> Result<(), Failure> {
        let found = registry::registry().inspect_map(&self.map, reference(self.reference.as_deref())?)?;
        if self.json {
            return output::print_json(&json!({
                "reference": found.map.reference,
                "efficiency": found.map.efficiency,
                "columns": found.columns,
                "remarks": found.remarks,
                "lines": found.map.lines.iter().map(|line| json!({
                    "speed_corrected_rpm": line.speed_corrected_rpm,
                    "points": line.points.len(),
                })).collect::<Vec<_>>(),
            }));
        }
        output::print(&imported_map_text(&found))
    }
}
