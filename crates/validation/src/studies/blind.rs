//! `study: blind`: draws, records and diagnoses cases; only the score knows their causes.

use crate::blind::score::score;
use crate::blind::{
    CaseKind, Draw, Laboratory, OutsideUse, SIGMA_RANGE, StoredCase, Truth, draw_cases, record, seal,
};
use crate::studies::source::{CampaignSource, StudyError};
use mapper_fleet::{
    FleetError, ItemDraft, Kind, Output, Results, StudyDraft, StudyFile, WorkContext, WorkError,
};
use mapper_recording::ChannelMap;
use mapper_session::{Recorded, Registry, Session, json_text};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Blind cases.
pub struct Blind<'a>(pub &'a Registry);

/// Cases with withheld causes, drawn as `mapper gap blind make` draws them.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BlindStudy {
    /// Name of the study.
    #[serde(rename = "fleet")]
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$"), example = &"check")]
    _fleet: String,
    #[serde(rename = "study")]
    #[schemars(example = &"blind")]
    _study: String,
    /// Campaign with machine, schedule, declared uncertainties and tolerances, from this file.
    #[schemars(length(min = 1), example = &"../gap_rig.yaml")]
    campaign: PathBuf,
    /// Seed of all random draws.
    #[schemars(example = 424242)]
    seed: u64,
    #[schemars(range(min = 1), example = 100)]
    cases: usize,
    /// Kinds of cases (none, single, pair, outside, triple); the default is the first four.
    #[schemars(with = "Option<Vec<String>>", extend("examples" = [["single", "pair"]]))]
    kinds: Option<Vec<CaseKind>>,
    /// Simulator that makes the recordings: virtual_lab (the default), or other_lab or two_masses, whose equations are not the model's.
    #[serde(default)]
    #[schemars(with = "Option<String>", example = &"other_lab")]
    laboratory: Laboratory,
    /// Minimum and maximum signature of a cause, in sigmas.
    #[schemars(extend("examples" = [[12, 400]]))]
    sigmas: Option<[f64; 2]>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BlindItem {
    campaign: CampaignSource,
    case: StoredCase,
    laboratory: Laboratory,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BlindPart {
    truth: Truth,
    diagnosis: Value,
}

impl Kind for Blind<'_> {
    fn name(&self) -> &'static str {
        "blind"
    }

    fn summary(&self) -> &'static str {
        "cases with withheld causes, recorded, diagnosed and scored"
    }

    fn items(&self, study: &StudyFile) -> Result<StudyDraft, FleetError> {
        let file: BlindStudy = study.read()?;
        let (campaign, nominal) = CampaignSource::read(&study.sibling_path(&file.campaign), self.0)?;
        let sigma_range = file.sigmas.unwrap_or(SIGMA_RANGE);
        if !(0.0 < sigma_range[0] && sigma_range[0] <= sigma_range[1] && sigma_range[1].is_finite()) {
            let message = format!("{} to {} is not a range of lengths", sigma_range[0], sigma_range[1]);
            return Err(study
                .mistake("sigmas", message, "write the minimum and the maximum, e.g. [12, 400]")
                .into());
        }
        let draw = Draw {
            kinds: file.kinds.unwrap_or_default(),
            sigma_range,
            laboratory: file.laboratory,
            ..Draw::new(file.seed, file.cases, OutsideUse::Check)
        };
        let cases = draw_cases(&nominal, &self.0.effects, &draw).map_err(FleetError::kind)?;
        let item = |case: &crate::blind::Case| ItemDraft {
            name: case.name.clone(),
            payload: json!(BlindItem {
                campaign: campaign.clone(),
                case: StoredCase::from(case),
                laboratory: file.laboratory
            }),
        };
        Ok(StudyDraft {
            items: cases.iter().map(item).collect(),
            settings: json!({ "campaign": nominal.name, "laboratory": file.laboratory }),
        })
    }

    fn work(&self, payload: &Value, at: WorkContext<'_>) -> Result<String, WorkError> {
        let BlindItem { campaign, case, laboratory } = BlindItem::deserialize(payload)?;
        let campaign = campaign.campaign()?;
        let case = case.case(&self.0.effects).map_err(StudyError::Cause)?;
        let file = at.scratch.join("case.mcap");
        let truth = record(&campaign, &case, laboratory, &file)?;
        // The diagnosis reads the recording file, which has no truth, as for a user.
        let recorded = Recorded::read(self.0, &file, &ChannelMap::native(), Some(&campaign))?;
        let session = Session { stop: at.stop, ..Session::new(self.0) };
        let gap = session.diagnose_gap(
            &recorded,
            &campaign,
            &ChannelMap::native(),
            self.0.effects.clone(),
            None,
        )?;
        Ok(serde_json::to_string(&BlindPart { truth, diagnosis: gap.json()? })?)
    }

    fn merge(&self, settings: &Value, parts: &mut Results<'_>, out: &Output) -> Result<String, FleetError> {
        let mut truths = Vec::new();
        for (name, body) in parts {
            let Ok(body) = body else { continue };
            let invalid = |source| StudyError::Content { name: name.clone(), source };
            let BlindPart { truth, diagnosis } = serde_json::from_str(&body).map_err(invalid)?;
            // The name becomes a file name, so only names of cases are accepted.
            if truth.name != name || !name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_') {
                return Err(invalid(serde::de::Error::custom("it is another case")).into());
            }
            let text = json_text(&diagnosis).map_err(FleetError::kind)?;
            out.write(&format!("{name}.diagnosis.json"), text.as_bytes())?;
            truths.push(truth);
        }
        let campaign = settings["campaign"].as_str().unwrap_or_default();
        let laboratory = Laboratory::deserialize(&settings["laboratory"]).unwrap_or_default();
        seal(campaign, laboratory, false, &truths, &out.directory).map_err(FleetError::kind)?;
        let scored = score(&out.directory).map_err(FleetError::kind)?;
        out.write("score.json", json_text(&scored).map_err(FleetError::kind)?.as_bytes())?;
        Ok(format!(
            "{} cases with their diagnoses and score.json; `mapper gap blind score` shows it",
            truths.len()
        ))
    }
}
