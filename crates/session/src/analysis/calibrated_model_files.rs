//! Files of the calibrated model: a diagnosis, and a pre-registered prediction.

use crate::SessionError;
use crate::recording::files::{DIAGNOSIS_FORMAT, FORECAST_FORMAT, json_text, read_at_most, write_new};
use mapper_diagnose::gap::{Expected, Found};
use mapper_planner::sha256_hex;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Maximum size of a diagnosis or prediction file, bytes.
const FILE_MAX_BYTES: u64 = 64 << 20;

/// The fields read from a diagnosis. Those of the first format, which had no number, are the same.
#[derive(Debug, Deserialize)]
struct Diagnosis {
    #[serde(default)]
    format_version: u32,
    found: Option<Found>,
}

/// The identified machine, from the JSON of a diagnosis.
///
/// # Errors
/// [`SessionError::File`] if it cannot be read, [`SessionError::CalibratedModelFile`] if it is not a diagnosis.
pub fn found_in(path: &Path) -> Result<Found, SessionError> {
    let diagnosis: Diagnosis = serde_json::from_str(&text_of(path)?)
        .map_err(|error| wrong(path, format!("not a diagnosis: {error}")))?;
    check_format(path, diagnosis.format_version, DIAGNOSIS_FORMAT)?;
    diagnosis.found.ok_or_else(|| {
        wrong(path, "it contains no identified machine; diagnose one recording without a baseline".to_owned())
    })
}

/// A prediction of the next recording, made before that recording is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealedForecast {
    /// Version of the keys; 0 in files that have no number, whose keys are those of version 1.
    #[serde(default)]
    pub format_version: u32,
    /// Name of the campaign.
    pub campaign: String,
    /// The identified machine, with its covariance.
    pub found: Found,
    /// Expected values at the ends of the planned steps, with the half-width of the 95 % interval.
    pub steps: Vec<Expected>,
}

impl SealedForecast {
    /// The forecast of a campaign's steps.
    pub fn new(campaign: String, found: Found, steps: Vec<Expected>) -> SealedForecast {
        SealedForecast { format_version: FORECAST_FORMAT, campaign, found, steps }
    }

    /// Writes a new file and returns its SHA-256.
    ///
    /// # Errors
    /// [`SessionError::File`] if the file exists or cannot be written.
    pub fn write(&self, path: &Path) -> Result<String, SessionError> {
        let text = json_text(self)?;
        write_new(path, text.as_bytes())?;
        Ok(sha256_hex(&text))
    }

    /// Reads a prediction and its SHA-256. `wanted`: the required hash, in digits of either case.
    ///
    /// # Errors
    /// [`SessionError::File`] if it cannot be read, [`SessionError::CalibratedModelFile`] if it has another hash or is not a prediction.
    pub fn read(path: &Path, wanted: Option<&str>) -> Result<(SealedForecast, String), SessionError> {
        let text = text_of(path)?;
        let seal = sha256_hex(&text);
        if let Some(wanted) = wanted.filter(|wanted| !wanted.eq_ignore_ascii_case(&seal)) {
            let why = format!("its SHA-256 is {seal}, not {wanted}: it is not the forecast that was sealed");
            return Err(wrong(path, why));
        }
        let forecast: SealedForecast =
            serde_json::from_str(&text).map_err(|error| wrong(path, format!("not a forecast: {error}")))?;
        check_format(path, forecast.format_version, FORECAST_FORMAT)?;
        Ok((forecast, seal))
    }
}

/// Refuses a file of a later program.
fn check_format(path: &Path, found: u32, known: u32) -> Result<(), SessionError> {
    let why =
        || format!("its format_version is {found}, and this program knows {known}: use a newer program");
    if found <= known { Ok(()) } else { Err(wrong(path, why())) }
}

fn text_of(path: &Path) -> Result<String, SessionError> {
    let bytes = read_at_most(path, FILE_MAX_BYTES)?;
    String::from_utf8(bytes).map_err(|_| wrong(path, "it is not UTF-8".to_owned()))
}

fn wrong(path: &Path, why: String) -> SessionError {
    SessionError::CalibratedModelFile { path: path.to_owned(), why }
}
