//! `mapper gap blind make`.

use crate::command_line::shared_arguments::renamed;
use crate::output::failure::Failure;
use crate::{
    output::{output_options, standard_output},
    registry,
};
use clap::Args;
use mapper_validation::blind::{CaseKind, Draw, Laboratory, OutsideUse};
use serde_json::json;
use std::path::PathBuf;

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
    #[arg(long, hide = true, num_args = 0..=1, default_missing_value = "", value_parser = renamed("--baseline"))]
    pub healthy: Option<PathBuf>,
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
        let made =
            mapper_validation::blind::make(&campaign, &registry::registry().effects, &draw, &self.out, &done);
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
