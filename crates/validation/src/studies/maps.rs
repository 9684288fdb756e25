//! `study: maps`: campaigns with several seeds, identified by several methods; all points are kept for coverage, tables and scatter.

use crate::studies::source::{CampaignSource, StudyError};
use mapper_core::Method;
use mapper_fleet::{
    FleetError, ItemDraft, Kind, Output, Results, StudyDraft, StudyFile, WorkContext, WorkError,
};
use mapper_session::{ErrorKind, NightlyRun, Registry, Session, nominal_model};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// Scored maps.
pub struct Maps<'a>(pub &'a Registry);

/// Maps of campaigns, for each seed and each identification method.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MapsStudy {
    /// Name of the study.
    #[serde(rename = "fleet")]
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$"), example = &"coverage")]
    _fleet: String,
    #[serde(rename = "study")]
    #[schemars(example = &"maps")]
    _study: String,
    #[schemars(length(min = 1), extend("examples" = [["../turbo_a.yaml"]]))]
    campaigns: Vec<PathBuf>,
    /// Seeds, whole numbers from 0; the default is each campaign's own.
    #[schemars(extend("uniqueItems" = true, "examples" = [[1, 2, 3]]))]
    seeds: Option<Vec<u64>>,
    /// Methods by which each recording is identified; the default is each campaign's own.
    #[schemars(with = "Option<Vec<String>>", extend("uniqueItems" = true, "examples" = [["joint", "dynamic"]]))]
    methods: Option<Vec<Method>>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MapsItem {
    campaign: CampaignSource,
    seed: u64,
    methods: Vec<Method>,
}

/// File of all points.
const POINTS: &str = "points.json";

impl Kind for Maps<'_> {
    fn name(&self) -> &'static str {
        "maps"
    }

    fn summary(&self) -> &'static str {
        "campaigns by seeds and methods, with all points"
    }

    fn items(&self, study: &StudyFile) -> Result<StudyDraft, FleetError> {
        let file: MapsStudy = study.read()?;
        let mut items = Vec::new();
        for path in &file.campaigns {
            let (source, campaign) = CampaignSource::read(&study.sibling_path(path), self.0)?;
            let declared_method = campaign.identification.method;
            for seed in file.seeds.clone().unwrap_or_else(|| vec![campaign.seed]) {
                let methods = file.methods.clone().unwrap_or_else(|| vec![declared_method]);
                let payload = json!(MapsItem { campaign: source.clone(), seed, methods });
                items.push(ItemDraft { name: format!("{} seed {seed}", campaign.name), payload });
            }
        }
        Ok(StudyDraft { items, settings: Value::Null })
    }

    fn work(&self, payload: &Value, at: WorkContext<'_>) -> Result<String, WorkError> {
        let MapsItem { campaign, seed, methods } = MapsItem::deserialize(payload)?;
        let campaign = campaign.campaign()?;
        let model = nominal_model(&campaign)?;
        let name = campaign.name.clone();
        let method = campaign.identification.method;
        let run = NightlyRun::new(campaign, model, method, seed, None);
        let session = Session { stop: at.stop, ..Session::new(self.0) };
        let points = run.points(&session, at.scratch, &methods).map_err(|error| match error.kind() {
            ErrorKind::Interrupted => WorkError::Interrupted,
            _ => WorkError::from(error),
        })?;
        let points = points.map_err(WorkError::Failed)?;
        let by_method: Map<String, Value> = methods.iter().map(ToString::to_string).zip(points).collect();
        Ok(json!({ "campaign": name, "seed": seed, "points": by_method }).to_string())
    }

    fn merge(&self, _: &Value, parts: &mut Results<'_>, out: &Output) -> Result<String, FleetError> {
        // Points are kept as text, because those of ten thousand maps would need too much memory as values.
        let mut text = String::from("[\n");
        let mut maps = 0;
        for (name, body) in parts {
            let Ok(body) = body else { continue };
            serde_json::from_str::<serde::de::IgnoredAny>(&body)
                .map_err(|source| StudyError::Content { name, source })?;
            text += if maps == 0 { "" } else { ",\n" };
            text += &body;
            maps += 1;
        }
        text += "\n]\n";
        out.write(POINTS, text.as_bytes())?;
        Ok(format!("the points of {maps} maps in {POINTS}"))
    }
}
