//! `mapper map compare`: differences between two maps.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::given::reference;
use crate::output::Replace;
use crate::{output, registry};
use clap::Args;
use mapper_report::{distinct_names, map_comparison_figure, map_comparison_text};
use std::path::PathBuf;

/// Show where two maps differ, in units and against their uncertainty
#[derive(Debug, Args)]
pub struct Compare {
    /// Map to compare with
    pub first: PathBuf,
    /// Map to compare
    pub second: PathBuf,
    /// Reference state of the first map, if its file does not give it
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
    /// Reference state of the second map, if its file does not give it
    #[arg(long, value_name = "STATE")]
    pub second_reference: Option<String>,
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
    /// Compares two maps.
    pub fn run(&self) -> Result<(), Failure> {
        let registry = registry::registry();
        let first = registry.read_map(&self.first, reference(self.reference.as_deref())?)?;
        let second = registry.read_map(&self.second, reference(self.second_reference.as_deref())?)?;
        let comparison =
            mapper_assemble::compare(&first, &second).map_err(|error| Failure::new(Code::BadInput, error))?;
        if let Some(path) = &self.picture {
            let names = distinct_names([&self.first, &self.second]);
            let figure = map_comparison_figure(&first, &second, &comparison, &names);
            let png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
            let bytes = if png {
                figure.to_png(2.0).map_err(|error| Failure::new(Code::Failure, error))?
            } else {
                figure.to_svg().into_bytes()
            };
            self.replace.write(path, &bytes)?;
        }
        if self.json {
            return output::print_json(&comparison);
        }
        output::print(&map_comparison_text(&comparison))
    }
}
