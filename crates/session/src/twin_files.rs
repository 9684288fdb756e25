//! Files of the calibrated twin: what a diagnosis found, and a forecast under seal.

use crate::SessionError;
use crate::files::{json_text, read_at_most, write_new};
use mapper_gap::twin::{Expected, Found};
use mapper_planner::sha256_hex;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Largest diagnosis or forecast that is read, bytes.
const FILE_MAX_BYTES: u64 = 64 << 20;

/// What is read of a diagnosis.
#[derive(Debug, Deserialize)]
struct Diagnosis {
    found: Option<Found>,
}

/// What a diagnosis found, from the file that `mapper gap diagnose --json` prints.
///
/// # Errors
/// [`SessionError::File`] where it cannot be read, [`SessionError::TwinFile`] where it is no diagnosis.
pub fn found_in(path: &Path) -> Result<Found, SessionError> {
    let diagnosis: Diagnosis = serde_json::from_str(&text_of(path)?)
        .map_err(|error| wrong(path, format!("not a diagnosis: {error}")))?;
    diagnosis.found.ok_or_else(|| {
        wrong(path, "it does not hold what was found; make it with `mapper gap diagnose --json`, of one recording and without --healthy".to_owned())
    })
}

/// A forecast of the next recording, made before it is seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealedForecast {
    /// Name of the campaign.
    pub campaign: String,
    /// The machine as found, with its covariance.
    pub found: Found,
    /// The ends of the planned steps: value and half the width of the 95 % band.
    pub steps: Vec<Expected>,
}

impl SealedForecast {
    /// Writes a new file; its SHA-256 is the seal.
    ///
    /// # Errors
    /// [`SessionError::File`] where the file exists or cannot be written.
    pub fn write(&self, path: &Path) -> Result<String, SessionError> {
        let text = json_text(self)?;
        write_new(path, text.as_bytes())?;
        Ok(sha256_hex(&text))
    }

    /// The forecast of a file, and its seal. `wanted`: the seal that it must have, in digits of either case.
    ///
    /// # Errors
    /// [`SessionError::File`] where it cannot be read, [`SessionError::TwinFile`] where it has another seal or is no forecast.
    pub fn read(path: &Path, wanted: Option<&str>) -> Result<(SealedForecast, String), SessionError> {
        let text = text_of(path)?;
        let seal = sha256_hex(&text);
        if let Some(wanted) = wanted.filter(|wanted| !wanted.eq_ignore_ascii_case(&seal)) {
            let why = format!("its SHA-256 is {seal}, not {wanted}: it is not the forecast that was sealed");
            return Err(wrong(path, why));
        }
        let forecast =
            serde_json::from_str(&text).map_err(|error| wrong(path, format!("not a forecast: {error}")))?;
        Ok((forecast, seal))
    }
}

fn text_of(path: &Path) -> Result<String, SessionError> {
    let bytes = read_at_most(path, FILE_MAX_BYTES)?;
    String::from_utf8(bytes).map_err(|_| wrong(path, "it is not UTF-8".to_owned()))
}

fn wrong(path: &Path, why: String) -> SessionError {
    SessionError::TwinFile { path: path.to_owned(), why }
}
