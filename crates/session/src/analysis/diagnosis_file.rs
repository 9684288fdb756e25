//! The file of a diagnosis, which corrections, pages, forecasts and calibrated models read instead of diagnosing again.

use crate::analysis::calibrated_model::{check_format, text_of, wrong};
use crate::recording::files::{DIAGNOSIS_FORMAT, PROGRAM, json_text};
use crate::recording::identification_config::identification_with;
use crate::recording::recording_file::Recorded;
use crate::recording::run_directory;
use crate::{SessionError, StoredDiagnosisError};
use mapper_campaign::Campaign;
use mapper_diagnose::drift::DriftReport;
use mapper_diagnose::gap::{Found, StoredFits};
use mapper_physics::rig::effect::Effect;
use mapper_planner::sha256_hex;
use mapper_recording::ChannelMap;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a diagnosis was made from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MadeFrom {
    program: String,
    /// Of the readings and steps as the channel map reads them.
    recording_sha256: String,
    /// Of the campaign and of what it and the channel map declare.
    campaign_sha256: String,
    effects_sha256: String,
    /// Whether only the changes since a reference recording were diagnosed.
    with_baseline: bool,
}

impl MadeFrom {
    pub(crate) fn of(
        recorded: &Recorded,
        (campaign, map): (&Campaign, &ChannelMap),
        effects: &[Arc<dyn Effect>],
        with_baseline: bool,
    ) -> Result<MadeFrom, SessionError> {
        let declared = (campaign, identification_with(campaign, map), format!("{:?}", map.redundant));
        Ok(MadeFrom {
            program: PROGRAM.to_owned(),
            recording_sha256: sha256_hex(&serde_json::to_string(&recorded.read.recording)?),
            campaign_sha256: sha256_hex(&serde_json::to_string(&declared)?),
            // A script's text is part of it.
            effects_sha256: sha256_hex(&format!("{effects:?}")),
            with_baseline,
        })
    }

    pub(crate) fn check(&self, wanted: &MadeFrom) -> Result<(), StoredDiagnosisError> {
        use StoredDiagnosisError as E;
        if self.program != wanted.program {
            return Err(E::Outdated { theirs: self.program.clone(), ours: wanted.program.clone() });
        }
        let checks = [
            (self.recording_sha256 == wanted.recording_sha256, E::OtherRecording),
            (self.campaign_sha256 == wanted.campaign_sha256, E::OtherCampaign),
            (self.effects_sha256 == wanted.effects_sha256, E::OtherEffects),
            (!self.with_baseline, E::WithBaseline),
        ];
        checks.into_iter().find(|(is_equal, _)| !is_equal).map_or(Ok(()), |(_, error)| Err(error))
    }
}

/// The key of the seal, as the text of a file has it.
const SEAL: &str = "\n  \"sha256\": \"";

/// Adds the SHA-256 of the whole text, in which it is empty itself.
pub(crate) fn sealed(mut value: Value) -> Result<Value, SessionError> {
    value["sha256"] = json!("");
    value["sha256"] = json!(sha256_hex(&json_text(&value)?));
    Ok(value)
}

/// Whether a text has the SHA-256 that stands in it; `None` if it has none.
fn is_as_sealed(text: &str) -> Option<bool> {
    let (before, after) = text.split_once(SEAL)?;
    let (seal, after) = after.split_once('"')?;
    Some(sha256_hex(&format!("{}{SEAL}\"{}\n", before, after.trim_end())) == seal)
}

/// The keys that are read from the file of a diagnosis. Those of `found` are the same in the first format, which had no number.
#[derive(Debug, Deserialize)]
pub(crate) struct DiagnosisFile {
    #[serde(default)]
    format_version: u32,
    pub(crate) found: Option<Found>,
    pub(crate) made_from: Option<MadeFrom>,
    pub(crate) fits: Option<StoredFits>,
    #[serde(default)]
    pub(crate) drift: Option<DriftReport>,
}

pub(crate) fn read(path: &Path) -> Result<(DiagnosisFile, String), SessionError> {
    let text = text_of(path)?;
    if is_as_sealed(&text) == Some(false) {
        return Err(refused(path, StoredDiagnosisError::Changed));
    }
    let file: DiagnosisFile = serde_json::from_str(&text)
        .map_err(|error| refused(path, StoredDiagnosisError::NotADiagnosis(error.to_string())))?;
    check_format(path, file.format_version, DIAGNOSIS_FORMAT)?;
    Ok((file, text))
}

/// The machine as found, from the file of a diagnosis.
pub fn found_in(path: &Path) -> Result<Found, SessionError> {
    read(path)?.0.found.ok_or_else(|| {
        wrong(path, "it contains no identified machine; diagnose one recording without a baseline".to_owned())
    })
}

pub(crate) fn refused(path: &Path, source: StoredDiagnosisError) -> SessionError {
    SessionError::StoredDiagnosis { path: path.to_owned(), source: Box::new(source) }
}

/// Where the diagnosis of a recording is looked for: `NAME.diagnosis.json` next to it.
pub(crate) fn next_to(recorded: &Recorded) -> PathBuf {
    recorded.path.with_extension("diagnosis.json")
}

/// The file that the diagnosis of a run is written to: the one next to its recording. `None` for a recording that is not in a run directory.
pub fn diagnosis_of_run(recorded: &Recorded) -> Option<PathBuf> {
    run_directory::is_recording(&recorded.path).then(|| next_to(recorded))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sealed_text_is_recognised_until_a_digit_changes() {
        let value = sealed(json!({"a": 0.1, "z": [1.5e-300, "sha256"], "of": {"sha256": "inner"}})).unwrap();
        let text = json_text(&value).unwrap();
        assert_eq!(is_as_sealed(&text), Some(true));
        // An editor adds or removes the last line break.
        assert_eq!(is_as_sealed(text.trim_end()), Some(true));
        for (from, to) in [("0.1", "0.2"), ("e-300", "e-30"), ("\"z\"", "\"y\""), ("inner", "other")] {
            let changed = text.replacen(from, to, 1);
            assert_ne!(changed, text);
            assert_eq!(is_as_sealed(&changed), Some(false), "{from}");
        }
        assert_eq!(is_as_sealed("{}"), None);
    }
}
