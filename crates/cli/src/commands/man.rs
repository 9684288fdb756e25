//! `mapper man`.

use crate::output::failure::{Code, Failure};
use crate::output::{output_options, standard_output};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

/// Write a manual page for the program and for each command; pages of the same names are replaced
#[derive(Debug, Args)]
pub struct Man {
    /// Directory for the pages, e.g. ~/.local/share/man/man1
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Man {
    pub fn run(&self) -> Result<(), Failure> {
        let failed =
            |error| Failure::new(Code::Failure, format!("failed to write {}: {error}", self.out.display()));
        std::fs::create_dir_all(&self.out).map_err(failed)?;
        clap_mangen::generate_to(output_options::commands(), &self.out).map_err(failed)?;
        if self.json {
            standard_output::print_json(&json!({ "directory": self.out }))
        } else {
            standard_output::print(&format!("manual pages in {}\n", self.out.display()))
        }
    }
}
