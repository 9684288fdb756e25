//! `mapper gap apply`: the machine that a diagnosis found, as the virtual lab of a campaign.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::{output, registry};
use clap::Args;
use mapper_gap::twin::Found;
use mapper_session::{Twin, twin_campaign, write_new};
use serde::Deserialize;
use std::path::{Path, PathBuf};

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

/// What is read of a diagnosis.
#[derive(Debug, Deserialize)]
struct Diagnosis {
    found: Option<Found>,
}

/// Largest diagnosis that is read, bytes.
const LARGEST_BYTES: u64 = 64 << 20;

/// What a diagnosis found.
pub fn found_in(path: &Path) -> Result<Found, Failure> {
    let bad = |message: String| Failure::new(Code::BadInput, format!("{}: {message}", path.display()));
    let length = std::fs::metadata(path).map_err(|error| bad(error.to_string()))?.len();
    if length > LARGEST_BYTES {
        return Err(bad(format!("{length} bytes are no diagnosis")));
    }
    let text = std::fs::read_to_string(path).map_err(|error| bad(error.to_string()))?;
    let diagnosis: Diagnosis =
        serde_json::from_str(&text).map_err(|error| bad(format!("not a diagnosis: {error}")))?;
    diagnosis.found.ok_or_else(|| {
        bad("it does not hold what was found; make it with mapper gap diagnose --json".to_owned())
    })
}

impl Apply {
    /// Writes the campaign.
    pub fn run(&self) -> Result<(), Failure> {
        // What is not a campaign is not changed into one.
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let text = std::fs::read_to_string(&self.campaign)
            .map_err(|error| Failure::new(Code::Failure, format!("{}: {error}", self.campaign.display())))?;
        let found = found_in(&self.diagnosis)?;
        let twin =
            Twin { found: &found, source: &self.diagnosis, p3_lag_s: campaign.tolerances.actuator_lag_s };
        let written = twin_campaign(&text, &twin, &registry::registry().effects)?;
        write_new(&self.out, written.as_bytes())?;
        mapper_campaign::load(&self.out).map_err(Failure::of_campaign)?;
        output::print(&format!("campaign with the machine as found in {}\n", self.out.display()))
    }
}
