//! What a run gives: points, map, report; the same for people and for machines.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::repeated_jumps::{self, RepeatedJump};
use crate::table::{self, Display, number};
use crate::test_report;
use crate::thermal_text::thermal_text;
use crate::zero::{self, Zero};
use crate::{assembly_line, output, run_directory};
use mapper_assemble::{Grouping, MapFit, MapFitOptions, assemble};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::DisplayUnits;
use mapper_core::{CompressorMap, IdentifiedPoint, Plan, StepKind, ThermalModel, Verdict};
use mapper_exporters::ExportError;
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use mapper_score::{ScoreSummary, ScoredPoint};
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Everything that came of a run, with the files it was written to.
pub struct Results {
    run: PathBuf,
    recording: PathBuf,
    report: PathBuf,
    /// Paths of the map by format.
    map: BTreeMap<String, PathBuf>,
    points: Vec<ScoredPoint>,
    score: Option<ScoreSummary>,
    repeats: Vec<RepeatedJump>,
    /// What the points share (joint method).
    thermal: Option<ThermalModel>,
    zero: Zero,
    remarks: Vec<String>,
}

/// Reads the recording back, identifies, assembles, exports and reports.
pub fn make(
    campaign: &Campaign,
    plan: &Plan,
    outcome: &str,
    directory: &Path,
    recording: &Path,
) -> Result<Results, Failure> {
    let read = read_recording(recording, &ChannelMap::native(), &ReadOptions::default())
        .map_err(|error| Failure::new(Code::BadRecording, error))?;
    let mut remarks: Vec<String> = read.warnings.iter().map(ToString::to_string).collect();
    let mut config = assembly_line::identification(campaign);
    config.method = campaign.identification.method;
    let (recorded, config, zero) = zero::apply(read.recording, config, campaign);
    let identified = mapper_identify::identify_recording(&recorded, &config)
        .map_err(|error| Failure::new(Code::BadRecording, error))?;
    let thermal = identified.thermal;
    let points: Vec<IdentifiedPoint> = identified.points.into_iter().filter_map(Result::ok).collect();

    let mut map = BTreeMap::new();
    let placed: Vec<IdentifiedPoint> = points.iter().filter(|point| has_place(point)).cloned().collect();
    match assemble(&placed, &campaign.machine.name, config.reference, config.method, Grouping::default()) {
        Ok(assembled) => {
            let assembled = fitted(assembled, &mut remarks);
            for format in &campaign.outputs.formats {
                let name = format.name();
                let Some(exporter) = mapper_exporters::find(name) else {
                    let message = format!("a map cannot be written in the format `{name}`");
                    return Err(Failure::new(Code::BadInput, message));
                };
                let bytes = match (exporter.export)(&assembled) {
                    Ok(bytes) => bytes,
                    // A campaign of a few points has a map, but no surface through it.
                    Err(error @ ExportError::NeedsFit { .. }) => {
                        remarks.push(error.to_string());
                        continue;
                    }
                    Err(error) => return Err(Failure::new(Code::Failure, error)),
                };
                let path = directory.join(format!("map.{}", exporter.extension));
                output::write_new(&path, &bytes)?;
                map.insert(name.to_owned(), path);
            }
        }
        Err(error) => remarks.push(format!("there is no map: {error}")),
    }
    let points = mapper_score::score(recording, &recorded.steps, points)
        .map_err(|error| Failure::new(Code::BadRecording, error))?;
    let score = mapper_score::summarise(&points);
    output::write_new(
        &directory.join(run_directory::POINTS),
        (output::to_json(&json!({"reference": config.reference, "points": points, "thermal": thermal, "zero": zero.json()}))?
            + "\n")
            .as_bytes(),
    )?;
    let report = directory.join(run_directory::REPORT);
    let repeats = repeated_jumps::repeated_jumps(&recorded.steps, &points);
    let text = test_report::markdown(
        campaign,
        plan,
        outcome,
        &recorded.events,
        &points,
        &repeats,
        score.as_ref(),
        &map,
    );
    output::write_new(&report, text.as_bytes())?;
    Ok(Results {
        run: directory.to_owned(),
        recording: recording.to_owned(),
        report,
        map,
        points,
        score,
        repeats,
        thermal,
        zero,
        remarks,
    })
}

/// The map with a surface through it, where it has enough points.
fn fitted(map: CompressorMap, remarks: &mut Vec<String>) -> CompressorMap {
    match MapFit::new(&map).and_then(|fit| fit.table(&MapFitOptions::default())) {
        Ok(table) => CompressorMap { fitted: Some(table), ..map },
        Err(error) => {
            remarks.push(format!("the map is not fitted: {error}"));
            map
        }
    }
}

fn has_place(point: &IdentifiedPoint) -> bool {
    [point.flow_corrected_kg_s, point.pressure_ratio, point.speed_corrected_rpm].iter().all(|v| v.is_finite())
}

impl Results {
    /// One object for machines.
    pub fn json(&self) -> serde_json::Value {
        json!({
            "run": self.run,
            "recording": self.recording,
            "points": self.points,
            "map": self.map,
            "report": self.report,
            "score": self.score,
            "repeats": self.repeats,
            "thermal": self.thermal,
            "zero": self.zero.json(),
            "remarks": self.remarks,
        })
    }

    /// A table with what to know below it.
    pub fn text(&self, campaign: &Campaign) -> String {
        let mut text = points_text(&self.points, &campaign.display);
        text.push_str(&repeated_jumps::sentences(&self.repeats, &Display::new(&campaign.display)));
        if let Some(thermal) = &self.thermal {
            text.push_str(&thermal_text(thermal));
        }
        text.push_str(&self.zero.text());
        for remark in &self.remarks {
            let _ = writeln!(text, "{remark}");
        }
        for path in self.map.values() {
            let _ = writeln!(text, "map        {}", path.display());
        }
        let _ = writeln!(text, "report     {}", self.report.display());
        let _ = writeln!(text, "recording  {}", self.recording.display());
        text
    }
}

/// Identified points as a table, their doubts below, and how far they are from the truth where it is known.
pub fn points_text(points: &[ScoredPoint], units: &DisplayUnits) -> String {
    let mut text = format!("{}\n\n", points_table(points, units));
    for ScoredPoint { point, .. } in points.iter().filter(|scored| scored.point.verdict != Verdict::Good) {
        for warning in &point.warnings {
            let _ = writeln!(text, "step {}: {}", point.step + 1, warning.message);
        }
    }
    let count = |verdict| points.iter().filter(|scored| scored.point.verdict == verdict).count();
    let _ = writeln!(
        text,
        "{} points: {} good, {} doubtful, {} unusable.",
        points.len(),
        count(Verdict::Good),
        count(Verdict::Doubtful),
        count(Verdict::Unusable),
    );
    if let Some(score) = mapper_score::summarise(points) {
        text.push_str(&score_text(&score));
    }
    text
}

/// How far the points are from what the simulator knows.
pub fn score_text(score: &ScoreSummary) -> String {
    let mut text = format!(
        "Against the simulator's truth ({} points): efficiency off by {:.2} points in the median, {:.2} at worst, {:.0} % \
         within 1 point; the 95 % interval holds it at {:.0} %.\n",
        score.points,
        100.0 * score.eta_median_error,
        100.0 * score.eta_worst_error,
        100.0 * score.eta_within_one_point_ratio,
        100.0 * score.eta_coverage_ratio,
    );
    if let (Some(median), Some(worst)) = (score.h_median_error_ratio, score.h_worst_error_ratio) {
        let _ = writeln!(
            text,
            "Heat-transfer coefficient off by {:.1} % in the median, {:.1} % at worst.",
            100.0 * median,
            100.0 * worst
        );
    }
    text
}

fn points_table(points: &[ScoredPoint], units: &DisplayUnits) -> comfy_table::Table {
    let display = Display::new(units);
    let with_truth = points.iter().any(|scored| scored.truth.is_some());
    let mut heads = vec![
        "step".to_owned(),
        display.speed_head("speed"),
        "opening 1".to_owned(),
        display.flow_head("corr. flow"),
        "PR 1".to_owned(),
        "eta %".to_owned(),
        "+/- points".to_owned(),
        "h W/(m2 K)".to_owned(),
        "+/- W/(m2 K)".to_owned(),
        "dT2 K".to_owned(),
        "verdict".to_owned(),
    ];
    if with_truth {
        heads.push("true eta %".to_owned());
        heads.push("true h".to_owned());
    }
    let mut table = table::with_heads(&heads);
    for ScoredPoint { point, truth } in points {
        let half = |low: Option<f64>, high: Option<f64>| Some(0.5 * (high? - low?));
        let percent = |value: Option<f64>| value.map(|value| 100.0 * value);
        let mut row = vec![
            step_name(point),
            display.speed(point.speed_rpm),
            format!("{}", point.valve_opening_ratio),
            display.flow(point.flow_corrected_kg_s),
            format!("{:.4}", point.pressure_ratio),
            number(percent(point.eta), 2),
            number(percent(half(point.eta_low, point.eta_high)), 2),
            number(point.h_w_m2k, 0),
            number(half(point.h_low_w_m2k, point.h_high_w_m2k), 0),
            number(point.dt2_k, 1),
            verdict_word(point.verdict).to_owned(),
        ];
        if with_truth {
            row.push(number(truth.map(|truth| 100.0 * truth.eta), 2));
            row.push(number(truth.map(|truth| truth.h_w_m2k), 0));
        }
        table.add_row(row);
    }
    table
}

/// The number of a point's step, from 1, and whether it is a repeat.
pub fn step_name(point: &IdentifiedPoint) -> String {
    match point.kind {
        StepKind::Point => (point.step + 1).to_string(),
        StepKind::Repeat => format!("{} repeat", point.step + 1),
    }
}

/// A verdict in a word.
pub fn verdict_word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Good => "good",
        Verdict::Doubtful => "doubtful",
        Verdict::Unusable => "unusable",
    }
}
