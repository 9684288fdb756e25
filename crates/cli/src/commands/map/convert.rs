//! `mapper map convert`: a map in another format, at another reference state.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::given::reference;
use crate::output::Replace;
use crate::{output, registry};
use clap::Args;
use mapper_assemble::convert_efficiency;
use mapper_core::EfficiencyDefinition;
use mapper_session::write_map_fitted_if_needed;
use serde_json::json;
use std::path::PathBuf;

/// Write a map in another format, at another reference state
#[derive(Debug, Args)]
pub struct Convert {
    /// Map (CSV, JSON or SAE text)
    pub map: PathBuf,
    /// New file; its extension gives the format unless `--to` does
    pub out: PathBuf,
    /// Format of the new file
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
    /// Reference state of the file's corrected quantities, if the file does not give it: SAE, Garrett, BorgWarner or "T, P"
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
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

const NO_DEFINITION: &str = "the file does not name the definition of its efficiencies: give it by `--efficiency`, e.g. `--efficiency \"constant_gamma 1.4\"`";

impl Convert {
    /// Reads a map and writes it again.
    pub fn run(&self) -> Result<(), Failure> {
        let registry = registry::registry();
        let format = registry.format_of(&self.out, self.to.as_deref())?;
        let to_reference = reference(self.to_reference.as_deref())?;
        let mut map = registry.read_map(&self.map, reference(self.reference.as_deref())?)?;
        if let Some(reference) = to_reference {
            map = map.at_reference(reference);
        }
        let efficiency = map.efficiency.or(self.efficiency);
        match (efficiency, self.to_efficiency) {
            (Some(from), Some(to)) => map = convert_efficiency(map, from, to),
            (None, Some(_)) => return Err(Failure::new(Code::BadInput, NO_DEFINITION)),
            (_, None) => map.efficiency = efficiency,
        }
        let (map, fitted_here) = write_map_fitted_if_needed(&self.out, format, map, self.replace.existing())?;
        let points: usize = map.lines.iter().map(|line| line.points.len()).sum();
        if self.json {
            return output::print_json(&json!({
                "file": self.out,
                "format": format.name,
                "reference": map.reference,
                "efficiency": map.efficiency,
                "lines": map.lines.len(),
                "points": points,
                "fitted": map.fitted.is_some(),
            }));
        }
        output::print(&format!(
            "{}: {}, {points} points on {} speed lines, corrected to {}{}\n",
            self.out.display(),
            format.name,
            map.lines.len(),
            map.reference,
            if fitted_here { "; the format is a table, so the map was fitted" } else { "" },
        ))
    }
}
