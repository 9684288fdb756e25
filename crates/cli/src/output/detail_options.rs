//! How much of identified points is shown.

use crate::output::output_options;
use crate::terminal::Shown;
use clap::Args;

/// Of a command that prints identified points.
#[derive(Debug, Args)]
pub struct ShownArguments {
    /// Show everything: wide tables, what all points share, repeats, sensors, the zero
    #[arg(long)]
    pub full: bool,
    /// Show the simulator's truth next to the points
    #[arg(long)]
    pub truth: bool,
}

impl ShownArguments {
    pub fn shown(&self) -> Shown {
        Shown { full: self.full, truth: self.truth, paint: output_options::paint() }
    }
}
