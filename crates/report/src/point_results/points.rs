//! Identified points, their warnings, and their deviations from the truth.

use crate::formatting::display::Display;
use crate::formatting::number::{number, percent};
use crate::formatting::table::{self, COLUMNS};
use crate::formatting::wrapped::wrapped;
use crate::plan::plan_text::{mark, marks_legend};
use crate::point_results::point_warnings::doubts;
use mapper_core::{IdentifiedPoint, StepKind, Verdict, step_number};
use mapper_recording::score::{ScoreSummary, ScoredPoint};
use std::fmt::Write;

/// Identified points as a table with their warnings below; deviations from the truth if it is known.
/// `truth`: whether to show the latter.
pub fn points_text(points: &[ScoredPoint], display: &Display, truth: bool) -> String {
    let kinds: Vec<StepKind> = points.iter().map(|scored| scored.point.kind).collect();
    let legend = wrapped(
        &format!("{}+/- covers the 95 % interval. dT2: change of T2 in the window.", marks_legend(&kinds)),
        COLUMNS,
        0,
    );
    let mut text = format!("{}\n\n{legend}\n", points_table(points, display, truth));
    let doubted = points.iter().map(|scored| &scored.point).filter(|point| point.verdict != Verdict::Good);
    for doubt in doubts(doubted) {
        let _ = writeln!(text, "{}: {}", doubt.steps(), doubt.message());
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
    if let Some(score) = mapper_recording::score::summarise(points).filter(|_| truth) {
        text.push_str(&score_text(&score));
    }
    text
}

/// Deviations of the points from the simulator's truth; `None` if the truth is unknown.
pub fn truth_text(points: &[ScoredPoint]) -> Option<String> {
    mapper_recording::score::summarise(points).map(|score| score_text(&score))
}

/// Deviations of the points from the simulator's truth.
pub fn score_text(score: &ScoreSummary) -> String {
    let mut text = format!(
        "Against the simulator's truth ({} points): median error of efficiency {:.2} points, {:.2} at worst, {:.0} % \
         within 1 point; the 95 % interval contains the truth at {:.0} % (points share the offsets of their sensors, so \
         that their intervals are right or wrong together).\n",
        score.points,
        100.0 * score.eta_median_error,
        100.0 * score.eta_worst_error,
        100.0 * score.eta_within_one_point_ratio,
        100.0 * score.eta_coverage_ratio,
    );
    if let (Some(median), Some(worst)) = (score.h_median_error_ratio, score.h_worst_error_ratio) {
        let _ = writeln!(
            text,
            "Median error of the heat-transfer coefficient {:.1} %, {:.1} % at worst; its 95 % interval contains the truth at {}.",
            100.0 * median,
            100.0 * worst,
            score
                .h_coverage_ratio
                .map_or_else(|| "no point".to_owned(), |ratio| format!("{:.0} %", 100.0 * ratio)),
        );
    }
    text
}

/// A valve opening with three decimals; `-` if the recording does not contain it.
pub fn opening(ratio: f64) -> String {
    // Valves are set to a thousandth at best.
    if ratio.is_finite() { ((1e3 * ratio).round() / 1e3).to_string() } else { "-".to_owned() }
}

fn points_table(points: &[ScoredPoint], display: &Display, truth: bool) -> table::TextTable {
    let with_truth = truth && points.iter().any(|scored| scored.truth.is_some());
    let mut heads = vec![
        "step".to_owned(),
        display.speed_head("speed"),
        "opening".to_owned(),
        display.flow_head("corr. flow"),
        "PR".to_owned(),
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
        let mut row = vec![
            format!("{}{}", step_number(point.step), mark(point.kind)),
            display.speed(point.speed_rpm),
            opening(point.valve_opening_ratio),
            display.flow(point.flow_corrected_kg_s),
            format!("{:.4}", point.pressure_ratio),
            percent(point.eta, 2),
            percent(point.eta_margin_95(), 2),
            number(point.h_w_m2k, 0),
            number(point.h_margin_95_w_m2k(), 0),
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
        StepKind::Point => step_number(point.step).to_string(),
        StepKind::Repeat => format!("{} repeat", step_number(point.step)),
        StepKind::Return => format!("{} again", step_number(point.step)),
        StepKind::Approach => format!("{} surge", step_number(point.step)),
    }
}

pub fn verdict_word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Good => "good",
        Verdict::Doubtful => "doubtful",
        Verdict::Unusable => "unusable",
    }
}
