//! `study: nightly`: the runs of a nightly campaign.

use crate::studies::source::{CampaignSource, StudyError};
use mapper_campaign::load_nightly;
use mapper_core::Method;
use mapper_fleet::{
    Fleet, FleetError, ItemDraft, Kind, Output, Results, StudyDraft, StudyFile, WorkContext, WorkError,
};
use mapper_history::RunRow;
use mapper_session::{
    DrawnMachine, ErrorKind, NightlyRun, PreparedNight, Registry, Session, json_text, nominal_model,
    program_and_commit,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Nightly maps.
pub struct Nightly<'a>(pub &'a Registry);

/// The runs of a nightly campaign, one item each.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NightlyStudy {
    /// Name of the study.
    #[serde(rename = "fleet")]
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$"), example = &"night")]
    _fleet: String,
    #[serde(rename = "study")]
    #[schemars(example = &"nightly")]
    _study: String,
    /// The nightly campaign, from this file.
    #[schemars(length(min = 1), example = &"../nightly.yaml")]
    nightly: PathBuf,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct NightlyItem {
    campaign: CampaignSource,
    method: Method,
    seed: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    machine: Option<DrawnMachine>,
}

/// File of the rows.
const RUNS: &str = "runs.json";

impl Kind for Nightly<'_> {
    fn name(&self) -> &'static str {
        "nightly"
    }

    fn summary(&self) -> &'static str {
        "the maps of a nightly campaign"
    }

    fn items(&self, study: &StudyFile) -> Result<StudyDraft, FleetError> {
        let file = study.sibling_path(&study.read::<NightlyStudy>()?.nightly);
        let nightly = load_nightly(&file).map_err(FleetError::kind)?;
        let night = PreparedNight::new(&nightly).map_err(FleetError::kind)?;
        let mut sources = BTreeMap::new();
        for group in &nightly.groups {
            let (source, campaign) = CampaignSource::read(&group.campaign, self.0)?;
            sources.insert(campaign.name, source);
        }
        let item = |run: &NightlyRun| {
            let campaign = sources.get(&run.campaign.name)?.clone();
            let (method, seed) = (run.campaign.identification.method, run.campaign.seed);
            let payload = json!(NightlyItem { campaign, method, seed, machine: run.machine.clone() });
            Some(ItemDraft { name: run.key.to_string(), payload })
        };
        let items = night.runs().iter().filter_map(item).collect();
        Ok(StudyDraft { items, settings: json!({ "night": nightly.name }) })
    }

    fn work(&self, payload: &Value, at: WorkContext<'_>) -> Result<String, WorkError> {
        let item = NightlyItem::deserialize(payload)?;
        let campaign = item.campaign.campaign()?;
        let model = nominal_model(&campaign)?;
        let run = NightlyRun::new(campaign, model, item.method, item.seed, item.machine);
        let session = Session { stop: at.stop, ..Session::new(self.0) };
        let row = session.nightly_run(&run, &at.scratch.join("run")).map_err(|error| match error.kind() {
            ErrorKind::Interrupted => WorkError::Interrupted,
            _ => WorkError::from(error),
        })?;
        Ok(serde_json::to_string(&row)?)
    }

    fn merge(&self, _: &Value, parts: &mut Results<'_>, out: &Output) -> Result<String, FleetError> {
        let mut rows: Vec<RunRow> = Vec::new();
        for (name, body) in parts {
            let Ok(body) = body else { continue };
            rows.push(serde_json::from_str(&body).map_err(|source| StudyError::Content { name, source })?);
        }
        out.write(RUNS, json_text(&rows).map_err(FleetError::kind)?.as_bytes())?;
        Ok(format!(
            "{} runs in {RUNS}; `mapper nightly FILE --fleet DIR` compares and keeps them",
            rows.len()
        ))
    }
}

/// The rows of a merged study, for a night.
pub fn rows_of(directory: &Path, registry: &Registry) -> Result<Vec<RunRow>, FleetError> {
    let fleet = Fleet::open(directory, &program_and_commit(registry.commit))?;
    let path = fleet.result().join(RUNS);
    let text = merged_text(&path)?;
    serde_json::from_str(&text)
        .map_err(|source| StudyError::Content { name: path.display().to_string(), source }.into())
}

fn merged_text(path: &Path) -> Result<String, FleetError> {
    let mut text = String::new();
    mapper_yaml::open_file(path).and_then(|mut file| file.read_to_string(&mut text)).map(|_| text).map_err(
        |source| FleetError::File { action: "read the merged runs in", path: path.to_owned(), source },
    )
}
