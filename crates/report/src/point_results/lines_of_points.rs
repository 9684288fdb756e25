//! Identified points by speed line, for a terminal of 80 columns.

use crate::formatting::display::Display;
use crate::formatting::number::{number, percent};
use crate::formatting::paint::{Paint, paint_verdict};
use crate::formatting::table::{COLUMNS, with_heads};
use crate::formatting::wrapped::wrapped;
use crate::point_results::point_warnings::{Doubt, doubts};
use crate::point_results::points::opening;
use crate::verdict_word;
use mapper_core::{CompressorMap, IdentifiedPoint, SpeedLine, Verdict, step_number};
use mapper_numerics::statistics::mean;
use mapper_recording::score::ScoredPoint;

/// The points of the map by speed line from surge to choke, followed by the points outside it; without repeats, which serve only
/// for comparison. With their true efficiency if `truth` is set and it is known.
pub fn points_by_line_text(
    points: &[ScoredPoint],
    map: Option<&CompressorMap>,
    display: &Display,
    truth: bool,
    paint: Paint,
) -> String {
    let truth = truth && points.iter().any(|scored| scored.truth.is_some());
    let mut heads = vec![
        display.units().speed.clone(),
        "step".to_owned(),
        "opening".to_owned(),
        display.units().flow.clone(),
        "PR".to_owned(),
        "eta %".to_owned(),
        "+/-".to_owned(),
        "h".to_owned(),
        "+/-".to_owned(),
    ];
    if truth {
        heads.push("true %".to_owned());
    }
    let mut table = with_heads(&heads);
    let mut verdicts = Vec::new();
    let mut add = |name: String, scored: &ScoredPoint| {
        let mut row = row(display, &scored.point);
        row.insert(0, name);
        if truth {
            row.push(number(scored.truth.as_ref().map(|truth| 100.0 * truth.eta), 2));
        }
        table.add_row(row);
        verdicts.push(scored.point.verdict);
    };
    let mut on_a_line = Vec::new();
    for (speed_rpm, steps) in speed_lines(points, map) {
        let mut own_points: Vec<&ScoredPoint> =
            points.iter().filter(|scored| steps.contains(&scored.point.step)).collect();
        own_points.sort_by(|a, b| a.point.flow_corrected_kg_s.total_cmp(&b.point.flow_corrected_kg_s));
        for (index, scored) in own_points.into_iter().enumerate() {
            let name = if index == 0 { display.line_name(speed_rpm) } else { String::new() };
            add(name, scored);
            on_a_line.push(scored.point.step);
        }
    }
    // A point with a repeat visit is on the map once, by the more certain visit.
    let is_on_a_line = |scored: &ScoredPoint| {
        let visits = points.iter().filter(|other| on_a_line.contains(&other.point.step));
        let same = |other: &ScoredPoint| {
            scored.point.target.zip(other.point.target).is_some_and(|(a, b)| a.is_same_place(&b))
        };
        on_a_line.contains(&scored.point.step) || visits.into_iter().any(same)
    };
    let others = points.iter().filter(|scored| scored.point.kind.measures() && !is_on_a_line(scored));
    // Without lines, each point has its measured speed.
    let mut name = (!on_a_line.is_empty()).then(|| "no line".to_owned());
    for scored in others {
        let own_points = || display.speed(scored.point.speed_corrected_rpm);
        let name = if on_a_line.is_empty() { own_points() } else { name.take().unwrap_or_default() };
        add(name, scored);
    }
    let rendered = table.to_string();
    let legend = format!(
        "Points by corrected speed in {} and opening of the back-pressure valve, corrected flow in {}, h in W/(m2 K).",
        display.units().speed,
        display.units().flow
    );
    let mut text = wrapped(&legend, COLUMNS, 2);
    if let Some(map) = map {
        let definition = map.efficiency.map(|definition| format!("; eta: {}", definition.description()));
        let gas = map.gas.as_ref().map(|gas| format!("; gas: {gas}"));
        let [definition, gas] = [definition, gas].map(Option::unwrap_or_default);
        text.push_str(&wrapped(&format!("Corrected to {}{definition}{gas}.", map.reference), COLUMNS, 2));
    }
    text.push('\n');
    for (index, line) in rendered.lines().enumerate() {
        text.push_str(line);
        // A good point needs no remark.
        match index.checked_sub(1).and_then(|row| verdicts.get(row)) {
            Some(verdict) if *verdict != Verdict::Good => {
                text.push_str("  ");
                text.push_str(&paint_verdict(*verdict, verdict_word(*verdict), paint));
            }
            _ => {}
        }
        text.push('\n');
    }
    text
}

/// Corrected speed of each line, rpm, and the steps on it: those of the map, or else steps with one target speed.
fn speed_lines(points: &[ScoredPoint], map: Option<&CompressorMap>) -> Vec<(f64, Vec<usize>)> {
    if let Some(map) = map {
        let steps = |line: &SpeedLine| line.points.iter().map(|point| point.identified.step).collect();
        return map.lines.iter().map(|line| (line.speed_corrected_rpm, steps(line))).collect();
    }
    let measured = points.iter().map(|scored| &scored.point).filter(|point| point.kind.measures());
    let mut targeted: Vec<(f64, &IdentifiedPoint)> =
        measured.filter_map(|point| Some((point.target?.speed_rpm, point))).collect();
    targeted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let groups = targeted.chunk_by(|a, b| a.0 == b.0);
    let line = |group: &[(f64, &IdentifiedPoint)]| {
        let speed_rpm = mean(group.iter().map(|(_, point)| point.speed_corrected_rpm)).unwrap_or(f64::NAN);
        (speed_rpm, group.iter().map(|(_, point)| point.step).collect())
    };
    groups.map(line).collect()
}

fn row(display: &Display, point: &IdentifiedPoint) -> Vec<String> {
    vec![
        step_number(point.step).to_string(),
        opening(point.valve_opening_ratio),
        display.flow(point.flow_corrected_kg_s),
        format!("{:.4}", point.pressure_ratio),
        percent(point.eta, 2),
        percent(point.eta_margin_95(), 2),
        number(point.h_w_m2k, 0),
        number(point.h_margin_95_w_m2k(), 0),
    ]
}

/// Why points are not good: the first reason of each point, a sentence each. A reason that several points share is given once.
pub fn first_doubts_text(points: &[ScoredPoint]) -> String {
    let first_only: Vec<IdentifiedPoint> = points
        .iter()
        .map(|scored| &scored.point)
        .filter(|point| point.verdict != Verdict::Good)
        .map(|point| IdentifiedPoint {
            warnings: point.warnings.iter().take(1).cloned().collect(),
            ..point.clone()
        })
        .collect();
    let remarks = doubts(first_only.iter());
    let named = |doubt: &Doubt<'_>| {
        let steps = if doubt.count() == points.len() && points.len() > 1 {
            "all steps".to_owned()
        } else {
            doubt.steps()
        };
        wrapped(&format!("{steps}: {}", doubt.message()), COLUMNS, 2)
    };
    remarks.iter().map(named).collect()
}

/// Number of points with each verdict, in a sentence.
pub fn verdict_sentence<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> String {
    let verdicts: Vec<Verdict> = points.map(|point| point.verdict).collect();
    let count = |verdict| verdicts.iter().filter(|other| **other == verdict).count();
    match (verdicts.len(), count(Verdict::Good)) {
        (0, _) => "No point was identified.".to_owned(),
        (1, 1) => "The point is good.".to_owned(),
        (all, good) if all == good => format!("The points of all {all} steps are good."),
        (all, good) => format!(
            "The points of {good} of {all} steps are good, {} doubtful, {} unusable.",
            count(Verdict::Doubtful),
            count(Verdict::Unusable)
        ),
    }
}
