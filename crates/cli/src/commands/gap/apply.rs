//! `mapper gap apply`: the machine that a diagnosis found, as the virtual lab of a campaign.

use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::{output::standard_output, registry};
use clap::Args;
use mapper_session::{Twin, found_in, twin_campaign, write_new};
use std::path::PathBuf;

/// Write a campaign whose virtual lab is the machine that a diagnosis found: its effects, and by how much it is off
#[derive(Debug, Args)]
pub struct Apply {
    /// Campaign that was diagnosed (YAML)
    pub campaign: PathBuf,
    /// Diagnosis, as `mapper gap diagnose --json` prints it
    pub diagnosis: PathBuf,
    /// New campaign file (YAML): `plan`, `run` and `nightly` take it as any other
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

impl Apply {
    /// Writes the campaign.
    pub fn run(&self) -> Result<(), Failure> {
        // What is not a campaign is not changed into one.
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let text = mapper_campaign::read_text(&self.campaign)
            .map_err(|error| Failure::new(Code::Failure, format!("{}: {error}", self.campaign.display())))?;
        let found = found_in(&self.diagnosis)?;
        let twin =
            Twin { found: &found, source: &self.diagnosis, p3_lag_s: campaign.tolerances.actuator_lag_s };
        let written = twin_campaign(&text, &twin, &registry::registry().effects)?;
        write_new(&self.out, written.as_bytes())?;
        mapper_campaign::load(&self.out).map_err(Failure::of_campaign)?;
        standard_output::print(&format!("campaign with the machine as found in {}\n", self.out.display()))
    }
}
