//! `mapper gap blind calibrate`.

use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::output::standard_output::Replace;
use crate::{
    interrupt,
    output::{output_options, standard_output},
    registry,
};
use clap::Args;
use mapper_fleet::Engine;
use mapper_session::json_text;
use mapper_validation::blind::calibration::calibrate::{Plan, calibrate};
use mapper_validation::blind::scoring::reliability::{calibrated_text, reliabilities};
use serde_json::json;
use std::path::PathBuf;

/// Calibrate the probabilities on separate cases, whose outside causes are not used in the check
#[derive(Debug, Args)]
pub struct Calibrate {
    /// Campaign with machine, schedule, declared uncertainties and tolerances (YAML)
    #[arg(long, value_name = "FILE", default_value = "campaigns/gap_rig.yaml")]
    pub campaign: PathBuf,
    /// Seed of all random draws
    #[arg(long)]
    pub seed: u64,
    /// Number of cases without a cause, which set the threshold
    #[arg(long)]
    pub nulls: usize,
    /// Number of cases of the other kinds
    #[arg(long)]
    pub cases: usize,
    /// New file for the calibration (JSON)
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Also write the result of each case to this new file (JSON)
    #[arg(long, value_name = "FILE")]
    pub observed: Option<PathBuf>,
    /// Number of diagnoses at a time [default: all cores]
    #[arg(long, value_name = "COUNT")]
    pub jobs: Option<usize>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub replace: Replace,
}

impl Calibrate {
    /// Draws, records and diagnoses separate cases, and writes the calibration that fits them.
    pub fn run(&self) -> Result<(), Failure> {
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let plan = Plan { seed: self.seed, nulls: self.nulls, others: self.cases };
        let (stop, progress) = (interrupt::stop_flag()?, output_options::progress());
        let report = |done, of| progress.pieces(done, of);
        let engine = Engine { jobs: self.jobs, stop: &stop, on_progress: &report };
        let made_by = plan.command(&self.campaign);
        let fitted = calibrate(&campaign, &registry::registry().effects, &plan, made_by, &engine);
        progress.clear();
        let stopped = || Failure::new(Code::Interrupted, "stopped; `mapper fleet` keeps finished cases");
        let (calibration, observed) = fitted?.ok_or_else(stopped)?;
        self.replace.write(&self.out, json_text(&calibration)?.as_bytes())?;
        if let Some(file) = &self.observed {
            self.replace.write(file, json_text(&observed)?.as_bytes())?;
        }
        let (fitted, made) = (reliabilities(&observed)?, observed.len());
        match self.json {
            true => standard_output::print_json(
                &json!({"calibration": self.out, "diagnoses": made, "reliability": fitted}),
            ),
            false => standard_output::print(&calibrated_text(made, &self.out, &fitted)),
        }
    }
}
