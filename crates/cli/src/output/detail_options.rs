//! Level of detail of identified points.

use crate::output::output_options;
use crate::terminal::DetailLevel;
use clap::Args;

/// Options of commands that print identified points.
#[derive(Debug, Args)]
pub struct DetailArguments {
    /// Show everything: wide tables, common parameters, repeats, sensors, the zero
    #[arg(long)]
    pub full: bool,
    /// Show the simulator's truth next to the points
    #[arg(long)]
    pub truth: bool,
}

impl DetailArguments {
    pub fn detail_level(&self) -> DetailLevel {
        DetailLevel { full: self.full, truth: self.truth, paint: output_options::paint() }
    }
}
