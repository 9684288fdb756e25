//! `mapper gap blind`: diagnoses of cases whose causes are withheld.

use crate::command_line::{key_and_value, subcommands};
use crate::environment::registry;
use crate::interrupt;
use crate::output::failure::{Code, Failure};
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_fleet::{Engine, cores};
use mapper_report::{Document, Table};
use mapper_session::write_new;
use mapper_validation::blind::score::{open_answers, score};
use mapper_validation::blind::{
    ANSWERS_NAME, CaseKind, Draw, Laboratory, MANIFEST_NAME, Manifest, OutsideUse, Planted, plant,
};
use serde_json::json;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Check the diagnosis on data whose causes are withheld
#[derive(Debug, Args)]
pub struct Blind {
    #[command(subcommand)]
    command: BlindCommand,
}

subcommands! { BlindCommand:
    Make,
    Plant,
    Run,
    Score,
}

impl Blind {
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}

/// Draw cases on the virtual lab, record them, seal their causes and print the seal
#[derive(Debug, Args)]
pub struct Make {
    /// Campaign with machine, schedule, declared uncertainties and tolerances (YAML)
    #[arg(long, value_name = "FILE", default_value = "campaigns/gap_rig.yaml")]
    pub campaign: PathBuf,
    /// Directory for the cases
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Seed of all random draws
    #[arg(long)]
    pub seed: u64,
    /// Number of cases
    #[arg(long)]
    pub cases: usize,
    /// Draw only cases of this kind (none, single, pair, outside, triple); may be repeated
    #[arg(long = "kind", value_name = "KIND")]
    kinds: Vec<CaseKind>,
    /// Minimum signature of a cause, in sigmas
    #[arg(long, value_name = "SIGMAS", default_value_t = mapper_validation::blind::SIGMA_RANGE[0])]
    pub least_sigma: f64,
    /// Maximum signature of a cause, in sigmas
    #[arg(long, value_name = "SIGMAS", default_value_t = mapper_validation::blind::SIGMA_RANGE[1])]
    pub most_sigma: f64,
    /// Draw outside causes from those kept for calibration, not from those reserved for the check
    #[arg(long)]
    pub calibration: bool,
    /// Simulator of the rig: virtual_lab, or other_lab or two_masses, whose equations no effect of the library has
    #[arg(long, value_name = "NAME", default_value = "virtual_lab")]
    laboratory: Laboratory,
    /// Also record each rig on another night without its causes, for `run` to give to the diagnosis with --baseline
    #[arg(long)]
    baseline: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Make {
    pub fn run(&self) -> Result<(), Failure> {
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let outside = if self.calibration { OutsideUse::Calibration } else { OutsideUse::Check };
        let draw = Draw {
            kinds: self.kinds.clone(),
            laboratory: self.laboratory,
            baseline: self.baseline,
            sigma_range: [self.least_sigma, self.most_sigma],
            ..Draw::new(self.seed, self.cases, outside)
        };
        let progress = output_options::progress();
        progress.pieces(0, self.cases);
        let done = |done| progress.pieces(done, self.cases);
        let made = mapper_validation::blind::make(&campaign, &registry().effects, &draw, &self.out, &done);
        progress.clear();
        let made = made?;
        if self.json {
            return standard_output::print_json(&json!({
                "directory": self.out,
                "cases": made.manifest.cases,
                "answers_sha256": made.manifest.answers_sha256,
            }));
        }
        standard_output::print(&format!(
            "{} cases in {}\nSHA-256 of the answers: {}\n",
            made.manifest.cases.len(),
            self.out.display(),
            made.manifest.answers_sha256,
        ))
    }
}

/// Seal what a colleague builds into a real rig, before it is recorded, and print the seal; the recording is then copied to DIR/NAME.mcap
#[derive(Debug, Args)]
pub struct Plant {
    /// Directory for the case
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Name of the case
    #[arg(long, value_name = "NAME", default_value = "rig", value_parser = case_name)]
    pub name: String,
    /// An effect of the library and its size in the unit of `mapper gap effects`, e.g. `valve_area=1.05`, `inner_node.phi=0.3`; may be repeated
    #[arg(long = "cause", value_name = "EFFECT=VALUE", value_parser = cause)]
    causes: Vec<(String, Option<String>, f64)>,
    /// A cause that no effect of the library describes, as a sentence
    #[arg(long, value_name = "TEXT")]
    pub outside: Option<String>,
    /// Campaign that the rig is recorded with (YAML)
    #[arg(long, value_name = "FILE", default_value = "campaigns/gap_rig.yaml")]
    pub campaign: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

fn case_name(text: &str) -> Result<String, String> {
    let is_plain = !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-');
    if is_plain { Ok(text.to_owned()) } else { Err("letters, digits, _ and -, e.g. `night_1`".to_owned()) }
}

fn cause(text: &str) -> Result<(String, Option<String>, f64), String> {
    let (key, value) = key_and_value(text)?;
    let value =
        value.trim().parse().map_err(|_| format!("`{value}` is not a number, e.g. `valve_area=1.05`"))?;
    Ok(match key.split_once('.') {
        Some((id, parameter)) => (id.to_owned(), Some(parameter.to_owned()), value),
        None => (key, None, value),
    })
}

impl Plant {
    pub fn run(&self) -> Result<(), Failure> {
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let case = Planted { name: &self.name, causes: &self.causes, outside: self.outside.as_deref() };
        let manifest = plant(&campaign, &registry().effects, case, &self.out)?;
        if self.json {
            return standard_output::print_json(&manifest);
        }
        standard_output::print(&format!(
            "SHA-256 of the answer: {}
Keep {} from whoever diagnoses until `mapper gap blind score`.
",
            manifest.answers_sha256,
            self.out.join(ANSWERS_NAME).display()
        ))
    }
}

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

/// Open the seal and print how often the diagnoses are right
#[derive(Debug, Args)]
pub struct Score {
    /// Directory of the cases
    pub directory: PathBuf,
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
        let mut document = Document::default();
        document.facts("", scored.rows());
        let mut rows = scored.class_rows().into_iter();
        let heads: Vec<String> = rows.next().into_iter().flatten().collect();
        let mut table = Table::new(heads);
        rows.for_each(|row| table.row(row));
        document.table(table);
        document.text("Brackets are exact 95 % intervals of the share.");
        standard_output::print(&scored.case_lines())?;
        standard_output::show(&document)
    }
}
