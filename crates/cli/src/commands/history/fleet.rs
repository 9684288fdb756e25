//! `mapper history fleet`: what the machines of a production have in common.

use crate::commands::history::{Chosen, opened};
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_history::productions;
use mapper_report::production_text;
use mapper_session::SessionError;
use serde_json::json;

/// Spread of a production at every point, machines that stand out, and the drift of the stand they share
#[derive(Debug, Args)]
pub struct Fleet {
    #[command(flatten)]
    chosen: Chosen,
    /// Print one JSON object on standard output
    #[arg(long)]
    json: bool,
}

impl Fleet {
    /// Fits a mixed model at every point and says what came out.
    pub fn run(&self) -> Result<(), Failure> {
        let (nights, points) =
            opened(&self.chosen)?.points(&self.chosen.filter()).map_err(SessionError::from)?;
        let productions = productions(&nights, &points);
        if self.json {
            return standard_output::print_json(
                &json!({"history": self.chosen.db, "productions": productions}),
            );
        }
        standard_output::print(&production_text(&productions))
    }
}
