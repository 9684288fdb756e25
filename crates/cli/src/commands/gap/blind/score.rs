//! `mapper gap blind score`.

use crate::failure::Failure;
use crate::output;
use clap::Args;
use mapper_blind::score::{open_answers, score};
use mapper_report::with_heads;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Open the seal and print how often the diagnoses are right
#[derive(Debug, Args)]
pub struct Score {
    /// Directory of the cases
    pub directory: PathBuf,
    /// Also write each answer as NAME.truth.json beside its recording
    #[arg(long)]
    pub open: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Score {
    /// Opens the seal and prints the table.
    pub fn run(&self) -> Result<(), Failure> {
        let score = score(&self.directory)?;
        if self.open {
            open_answers(&self.directory)?;
        }
        if self.json {
            return output::print_json(&score);
        }
        let mut text = String::new();
        for case in &score.cases {
            text += &format!(
                "{}: {} {}{} -> {} {} {}\n",
                case.name,
                case.kind.name(),
                list(&case.causes),
                case.sigma.map_or_else(String::new, |sigma| format!(" ({sigma:.0} sigma)")),
                case.verdict.as_deref().unwrap_or("no diagnosis"),
                list(&case.named),
                if case.right { "ok" } else { "WRONG" },
            );
        }
        text += "\n";
        for (label, value) in score.rows() {
            text += &format!("{label:28}{value}\n");
        }
        let mut rows = score.class_rows().into_iter();
        let heads: Vec<String> = rows.next().into_iter().flatten().collect();
        let mut table = with_heads(&heads);
        for row in rows {
            table.add_row(row);
        }
        output::print(&format!("{text}\n{table}\nBrackets are exact 95 % intervals of the share.\n"))
    }
}

fn list(ids: &BTreeSet<String>) -> String {
    if ids.is_empty() { "-".to_owned() } else { ids.iter().cloned().collect::<Vec<_>>().join(" + ") }
}
