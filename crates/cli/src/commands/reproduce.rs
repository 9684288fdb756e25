//! `mapper reproduce`: the paper's figures on the nominal model.

use crate::output::failure::{Code, Failure};
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_validation::reproduction::{FIGURES, picture_path};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Reproduce the paper's figures on the nominal model and compare with what the paper states
#[derive(Debug, Args)]
#[command(about = about())]
pub struct Reproduce {
    /// Directory for `reproduction.md` and the pictures; files of an earlier reproduction there are replaced
    #[arg(long, value_name = "DIR", default_value = "reproduction")]
    pub out: PathBuf,
    /// Print the paper's statements and the results here as one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

fn about() -> String {
    let figures = FIGURES.join(", ");
    format!(
        "Reproduce the paper's figures {figures} on the nominal model and compare with what the paper states"
    )
}

impl Reproduce {
    pub fn run(&self) -> Result<(), Failure> {
        let progress = output_options::progress();
        let mut done = 0;
        progress.pieces(0, FIGURES.len());
        let results = mapper_validation::reproduction::reproduce(|_| {
            done += 1;
            progress.pieces(done, FIGURES.len());
        });
        progress.clear();
        let results = results.map_err(|error| Failure::new(Code::Failure, error))?;
        for result in &results {
            write(&self.out.join(picture_path(result)), result.svg.as_bytes())?;
        }
        let page = self.out.join("reproduction.md");
        write(&page, mapper_validation::reproduction::reproduction_page(&results).as_bytes())?;
        if self.json {
            let figures: Vec<serde_json::Value> =
                results.iter().map(mapper_validation::reproduction::figure_json).collect();
            return standard_output::print_json(&json!({"page": page, "figures": figures}));
        }
        let mut text = String::new();
        for result in &results {
            text.push_str(&format!("Figure {}: {}\n", result.number, result.title));
            for statement in &result.statements {
                text.push_str(&format!(
                    "  {:11} {}\n              {}\n",
                    statement.verdict.to_string(),
                    statement.paper,
                    statement.here
                ));
            }
        }
        standard_output::print(&format!("{text}\n{}\n", page.display()))
    }
}

/// Writes a file of the reproduction. An existing file is replaced, because the program can always make it again.
fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    path.parent()
        .map_or(Ok(()), std::fs::create_dir_all)
        .and_then(|()| std::fs::write(path, bytes))
        .map_err(|error| Failure::new(Code::Failure, format!("failed to write {}: {error}", path.display())))
}
