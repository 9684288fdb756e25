//! `mapper gap blind run`.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::{manner, output};
use clap::Args;
use mapper_blind::{MANIFEST_NAME, Manifest};
use mapper_session::write_new;
use serde_json::json;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Diagnose the recordings that have no diagnosis yet
#[derive(Debug, Args)]
pub struct Run {
    /// Directory of the cases
    pub directory: PathBuf,
    /// Campaign given to the diagnosis (YAML)
    #[arg(long, value_name = "FILE", default_value = "campaigns/gap_rig.yaml")]
    pub campaign: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Run {
    /// Diagnoses each recording in a process of its own, as anybody would: `mapper gap diagnose ... --json`.
    pub fn run(&self) -> Result<(), Failure> {
        let failure = |message: String| Failure::new(Code::Failure, message);
        let manifest = Manifest::read(&self.directory.join(MANIFEST_NAME))?;
        let program = std::env::current_exe().map_err(|error| failure(error.to_string()))?;
        let progress = manner::progress();
        progress.pieces(0, manifest.cases.len());
        let mut failed = Vec::new();
        let names = manifest.cases.iter().filter(|name| !name.contains(['/', '\\']));
        for (index, name) in names.enumerate() {
            let of_case = |ending: &str| self.directory.join(format!("{name}.{ending}"));
            let diagnosis = of_case("diagnosis.json");
            if !diagnosis.exists() {
                let finished = Command::new(&program)
                    .args(["gap", "diagnose"])
                    .arg(&self.campaign)
                    .arg("--recording")
                    .arg(of_case("mcap"))
                    .arg("--json")
                    .stdin(Stdio::null())
                    .output()
                    .map_err(|error| failure(format!("failed to start {}: {error}", program.display())))?;
                if finished.status.success() {
                    write_new(&diagnosis, &finished.stdout)?;
                } else {
                    let said = String::from_utf8_lossy(&finished.stderr);
                    failed.push(format!("{name}: {}", said.lines().last().unwrap_or_default()));
                }
            }
            progress.pieces(index + 1, manifest.cases.len());
        }
        progress.clear();
        if failed.is_empty() {
            if self.json {
                return output::print_json(&json!({ "cases": manifest.cases, "directory": self.directory }));
            }
            let (cases, directory) = (manifest.cases.len(), self.directory.display());
            return output::print(&format!("{cases} diagnoses in {directory}\n"));
        }
        Err(failure(format!("{} recordings were not diagnosed:\n{}", failed.len(), failed.join("\n"))))
    }
}
