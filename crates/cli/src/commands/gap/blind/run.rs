//! `mapper gap blind run`.

use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::{
    interrupt,
    output::{output_options, standard_output},
};
use clap::Args;
use mapper_fleet::{Engine, cores};
use mapper_session::write_new;
use mapper_validation::blind::{MANIFEST_NAME, Manifest};
use serde_json::json;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Diagnose the recordings that have no diagnosis yet
#[derive(Debug, Args)]
pub struct Run {
    /// Directory of the cases
    pub directory: PathBuf,
    /// Campaign given to the diagnosis (YAML)
    #[arg(long, value_name = "FILE", default_value = "campaigns/gap_rig.yaml")]
    pub campaign: PathBuf,
    /// Number of diagnoses at a time [default: all cores]
    #[arg(long, value_name = "COUNT")]
    pub jobs: Option<usize>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Run {
    /// Diagnoses each recording in a process of its own, as a user would: `mapper gap diagnose ... --json`.
    pub fn run(&self) -> Result<(), Failure> {
        let failure = |message: String| Failure::new(Code::Failure, message);
        let manifest = Manifest::read(&self.directory.join(MANIFEST_NAME))?;
        let program = std::env::current_exe().map_err(|error| failure(error.to_string()))?;
        let (stop, progress) = (interrupt::stop_flag()?, output_options::progress());
        let report = |done, of| progress.pieces(done, of);
        let engine = Engine { jobs: self.jobs, stop: &stop, on_progress: &report };
        let names: Vec<&String> = manifest.cases.iter().filter(|name| !name.contains(['/', '\\'])).collect();
        let threads = (cores() / engine.parallel_jobs(names.len())).max(1);
        let diagnosed =
            engine.each(&names, |_, name| self.diagnose(&program, name, manifest.baseline, threads));
        progress.clear();
        let diagnosed: Vec<_> = diagnosed?.into_iter().collect::<Option<_>>().ok_or_else(|| {
            Failure::new(Code::Interrupted, "stopped by the operator; the same command continues from there")
        })?;
        let failed: Vec<String> = diagnosed.into_iter().filter_map(Result::err).collect();
        if failed.is_empty() {
            if self.json {
                return standard_output::print_json(
                    &json!({ "cases": manifest.cases, "directory": self.directory }),
                );
            }
            let (cases, directory) = (manifest.cases.len(), self.directory.display());
            return standard_output::print(&format!("{cases} diagnoses in {directory}\n"));
        }
        Err(failure(format!("{} recordings were not diagnosed:\n{}", failed.len(), failed.join("\n"))))
    }
    /// Diagnoses one case unless its diagnosis exists. The inner `Err` is the message of a failed diagnosis.
    fn diagnose(
        &self,
        program: &Path,
        name: &str,
        baseline: bool,
        threads: usize,
    ) -> Result<Result<(), String>, Failure> {
        let of_case = |ending: &str| self.directory.join(format!("{name}.{ending}"));
        let diagnosis = of_case("diagnosis.json");
        if diagnosis.exists() {
            return Ok(Ok(()));
        }
        let finished = Command::new(program)
            .args(["gap", "diagnose"])
            .arg(&self.campaign)
            .arg("--recording")
            .arg(of_case("mcap"))
            .arg("--json")
            .args(
                baseline
                    .then(|| [OsString::from("--baseline"), of_case("baseline.mcap").into()])
                    .into_iter()
                    .flatten(),
            )
            // Several run at once, so each gets its share of the cores.
            .env("RAYON_NUM_THREADS", threads.to_string())
            .stdin(Stdio::null())
            .output()
            .map_err(|error| {
                Failure::new(Code::Failure, format!("failed to start {}: {error}", program.display()))
            })?;
        if finished.status.success() {
            write_new(&diagnosis, &finished.stdout)?;
            return Ok(Ok(()));
        }
        let message = String::from_utf8_lossy(&finished.stderr);
        Ok(Err(format!("{name}: {}", message.lines().last().unwrap_or_default())))
    }
}
