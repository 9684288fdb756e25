//! `study: calibration`: cases from which the diagnosis learns to convert scores into probabilities.

use crate::blind::calibration::{CalibrationSettings, DiagnosisSummary, Plan, cases, fitted, undetermined};
use crate::blind::reliability::{Bin, Reliability, reliabilities, reliability_text};
use crate::blind::{Case, StoredCase};
use crate::studies::source::{CampaignSource, StudyError};
use mapper_chart::{Axis, Dash, Figure, Line, Panel, Scatter, ScatterPoint, palette};
use mapper_fleet::{
    FleetError, ItemDraft, Kind, Output, Results, StudyDraft, StudyFile, WorkContext, WorkError,
};
use mapper_session::{Registry, json_text};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Calibration of the diagnosis.
pub struct Calibration<'a>(pub &'a Registry);

/// Cases that calibrate the diagnosis, with outside causes that the check does not use.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CalibrationStudy {
    /// Name of the study.
    #[serde(rename = "fleet")]
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$"), example = &"calibration")]
    _fleet: String,
    #[serde(rename = "study")]
    #[schemars(example = &"calibration")]
    _study: String,
    /// Campaign with machine, schedule, declared uncertainties and tolerances, from this file.
    #[schemars(length(min = 1), example = &"../gap_rig.yaml")]
    campaign: PathBuf,
    /// Seed of all random draws.
    #[schemars(example = 77001)]
    seed: u64,
    /// Number of cases without a cause, which set the threshold.
    #[schemars(range(max = 100_000), example = 1500)]
    nulls: usize,
    /// Number of cases of the other kinds.
    #[schemars(range(max = 100_000), example = 500)]
    cases: usize,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationItem {
    campaign: CampaignSource,
    case: StoredCase,
}

impl Kind for Calibration<'_> {
    fn name(&self) -> &'static str {
        "calibration"
    }

    fn summary(&self) -> &'static str {
        "the calibration of the diagnosis"
    }

    fn items(&self, study: &StudyFile) -> Result<StudyDraft, FleetError> {
        let file: CalibrationStudy = study.read()?;
        let path = study.sibling_path(&file.campaign);
        let (campaign, nominal) = CampaignSource::read(&path, self.0)?;
        let plan = Plan { seed: file.seed, nulls: file.nulls, others: file.cases };
        let drawn = cases(&nominal, &self.0.effects, &plan).map_err(FleetError::kind)?;
        // Both draws number their cases from 0; the position in the list distinguishes them.
        let item = |(place, case): (usize, &Case)| ItemDraft {
            name: format!("{place:05} {}", case.kind.name()),
            payload: json!(CalibrationItem { campaign: campaign.clone(), case: StoredCase::from(case) }),
        };
        let items = drawn.iter().enumerate().map(item).collect();
        let settings = json!({ "made_by": plan.study(&path) });
        Ok(StudyDraft { items, settings })
    }

    fn work(&self, payload: &Value, _: WorkContext<'_>) -> Result<String, WorkError> {
        let CalibrationItem { campaign, case } = CalibrationItem::deserialize(payload)?;
        let campaign = campaign.campaign()?;
        let case = case.case(&self.0.effects).map_err(StudyError::Cause)?;
        let observed = CalibrationSettings::new(&campaign, &self.0.effects)?.observe(&case)?;
        Ok(serde_json::to_string(&observed)?)
    }

    fn merge(&self, settings: &Value, parts: &mut Results<'_>, out: &Output) -> Result<String, FleetError> {
        let mut observed: Vec<DiagnosisSummary> = Vec::new();
        for (name, body) in parts {
            let Ok(body) = body else { continue };
            let found: Option<DiagnosisSummary> =
                serde_json::from_str(&body).map_err(|source| StudyError::Content { name, source })?;
            // Cases that cannot be diagnosed are omitted.
            observed.extend(found);
        }
        let made_by = settings["made_by"].as_str().unwrap_or_default().to_owned();
        let made = fit_calibration(&observed, made_by)?;
        for (name, text) in made.files {
            out.write(name, text.as_bytes())?;
        }
        out.write("observed.json", json_text(&observed).map_err(FleetError::kind)?.as_bytes())?;
        Ok(made.summary)
    }
}

/// Result of a calibration study.
pub struct CalibrationResult {
    /// Files by name: calibration, reliability and its picture.
    pub files: Vec<(&'static str, String)>,
    /// Their description.
    pub summary: String,
}

/// Fits the calibration to diagnoses, and checks the reliability of its probabilities.
pub fn fit_calibration(
    observed: &[DiagnosisSummary],
    made_by: String,
) -> Result<CalibrationResult, FleetError> {
    let calibration = fitted(observed, made_by).map_err(FleetError::kind)?;
    let reliabilities = reliabilities(observed).map_err(FleetError::kind)?;
    let files = vec![
        ("calibration.json", json_text(&calibration).map_err(FleetError::kind)?),
        ("reliability.json", json_text(&reliabilities).map_err(FleetError::kind)?),
        ("reliability.svg", reliability_svg(&reliabilities)),
    ];
    let description = format!(
        "calibration.json from {} diagnoses in observed.json; reliability.svg\n{}\n{}",
        observed.len(),
        undetermined(&calibration).join("\n"),
        reliability_text(&reliabilities).trim_end()
    );
    Ok(CalibrationResult { files, summary: description })
}

/// A panel for each calibration: share of correct first answers over their predicted probability, %.
pub(crate) fn reliability_svg(reliabilities: &[Reliability]) -> String {
    let cases: usize =
        reliabilities.first().map_or(0, |summary| summary.bins.iter().map(|bin| bin.right.trials).sum());
    let mut figure = Figure::new("Reliability of the diagnosis' first answer")
        .subtitle(format!(
            "{cases} diagnoses. Bars: 95 % intervals of the share of correct answers; on the diagonal, the probabilities are correct."
        ))
        .panel_size_px(420.0, 420.0);
    for summary in reliabilities {
        figure = figure.panel(panel(summary));
    }
    figure.to_svg()
}

fn panel(summary: &Reliability) -> Panel {
    let percent = |share: f64| 100.0 * share;
    let error =
        summary.expected_calibration_error.map_or("-".to_owned(), |error| format!("{:.1} %", percent(error)));
    let point = |bin: &Bin| ScatterPoint {
        x: percent(bin.said),
        y: percent(bin.right_share),
        x_interval: None,
        y_interval: Some((percent(bin.right_low), percent(bin.right_high))),
    };
    Panel::new(
        Axis::new("probability given, %").range(0.0, 105.0),
        Axis::new("first answer right, %").range(0.0, 105.0),
    )
    .title(format!("calibration {}: error {error}", summary.calibration))
    .with(
        Line::new(vec![(0.0, 0.0), (100.0, 100.0)], palette::GREY)
            .dash(Dash::Dashed)
            .label("correct probabilities"),
    )
    .with(
        Scatter::new(summary.bins.iter().map(point).collect::<Vec<_>>(), palette::BLUE)
            .label("classes of 10 %"),
    )
}
