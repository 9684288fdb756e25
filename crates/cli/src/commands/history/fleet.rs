//! `mapper history fleet`: statistics of a production.

use crate::commands::history::{RunSelection, open_history};
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_history::analyse_productions;
use mapper_report::production_text;
use mapper_session::SessionError;
use serde_json::json;

/// Show the scatter of a production at every point, outlying machines, and the drift of their test stand
#[derive(Debug, Args)]
pub struct Fleet {
    #[command(flatten)]
    selection: RunSelection,
    /// Print one JSON object on standard output
    #[arg(long)]
    json: bool,
}

impl Fleet {
    pub fn run(&self) -> Result<(), Failure> {
        let (nights, points) =
            open_history(&self.selection)?.points(&self.selection.filter()).map_err(SessionError::from)?;
        let productions = analyse_productions(&nights, &points);
        if self.json {
            return standard_output::print_json(
                &json!({"history": self.selection.db, "productions": productions}),
            );
        }
        standard_output::print(&production_text(&productions))
    }
}
