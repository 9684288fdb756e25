//! `mapper gap apply`: writes a campaign whose virtual lab is the diagnosed machine.

use crate::environment::registry;
use crate::output::failure::{Code, Failure};
use crate::output::standard_output;
use clap::Args;
use mapper_report::Document;
use mapper_session::{CalibratedModel, calibrated_model_campaign, found_in, write_new};
use std::path::PathBuf;

/// Write a campaign whose virtual lab is the diagnosed machine, with its effects and deviations
#[derive(Debug, Args)]
pub struct Apply {
    /// Campaign that was diagnosed (YAML)
    pub campaign: PathBuf,
    /// Diagnosis, as `mapper gap diagnose --out` writes it
    pub diagnosis: PathBuf,
    /// New campaign file (YAML)
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

impl Apply {
    pub fn run(&self) -> Result<(), Failure> {
        // Rejects a file that is not a campaign.
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let text = mapper_campaign::read_text(&self.campaign)
            .map_err(|error| Failure::new(Code::Failure, format!("{}: {error}", self.campaign.display())))?;
        let found = found_in(&self.diagnosis)?;
        let p3_lag_s = campaign.tolerances.actuator_lag_s;
        let calibrated = CalibratedModel { found: &found, source: &self.diagnosis, p3_lag_s };
        let written = calibrated_model_campaign(&text, &calibrated, &registry().effects)?;
        write_new(&self.out, written.as_bytes())?;
        mapper_campaign::load(&self.out).map_err(Failure::of_campaign)?;
        let mut document = Document::default();
        document.text(format!("campaign with the diagnosed machine: {}", self.out.display()));
        document.text(found.doubt.map(|doubt| format!("warning: {doubt}")).unwrap_or_default());
        standard_output::show(&document)
    }
}
