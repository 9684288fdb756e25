//! `mapper gap blind score`.

use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_report::with_heads;
use mapper_validation::blind::scoring::score::{open_answers, score};
use mapper_validation::blind::{MANIFEST_NAME, Manifest};
use std::path::{Path, PathBuf};

/// Open the seal and print how often the diagnoses are right
#[derive(Debug, Args)]
pub struct Score {
    /// Directory of the cases
    pub directory: PathBuf,
    /// Print the table in Markdown, next to that of the cases in another directory
    #[arg(long, value_name = "DIR", conflicts_with = "json")]
    pub beside: Option<PathBuf>,
    /// Also write each answer as NAME.truth.json next to its recording
    #[arg(long)]
    pub open: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Score {
    pub fn run(&self) -> Result<(), Failure> {
        let scored = score(&self.directory)?;
        if self.open {
            open_answers(&self.directory)?;
        }
        if self.json {
            return standard_output::print_json(&scored);
        }
        if let Some(other) = &self.beside {
            let title = |of: &Path| Manifest::read(&of.join(MANIFEST_NAME)).map(|it| it.title());
            let (this, that) = (title(&self.directory)?, title(other)?);
            return standard_output::print(&scored.compare_with([&this, &that], &score(other)?));
        }
        let mut text = scored.case_lines() + "\n";
        for (label, value) in scored.rows() {
            text += &format!("{label:28}{value}\n");
        }
        let mut rows = scored.class_rows().into_iter();
        let heads: Vec<String> = rows.next().into_iter().flatten().collect();
        let mut table = with_heads(&heads);
        for row in rows {
            table.add_row(row);
        }
        standard_output::print(&format!("{text}\n{table}\nBrackets are exact 95 % intervals of the share.\n"))
    }
}
