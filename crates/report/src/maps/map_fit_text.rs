//! A map fit as text: the range of each line, and the prediction error of lines that were left out.

use crate::formatting::number::number;
use crate::formatting::table;
use crate::formatting::wrapped::wrapped;
use mapper_core::{CompressorMap, FittedLine, FittedMap, LeftOutLine, half_width_95};
use std::fmt::Write;

/// A row for each line and sentences below.
pub fn map_fit_text(map: &CompressorMap, fitted: &FittedMap) -> String {
    let heads = [
        "corrected rpm",
        "surge kg/s",
        "surge PR",
        "choke kg/s",
        "best eta %",
        "+/- points",
        "left out: distance %",
        "eta points",
        "",
    ];
    let mut rows = table::with_heads(&heads);
    for line in &fitted.lines {
        let left_out = fitted.left_out.iter().find(|l| l.speed_corrected_rpm == line.speed_corrected_rpm);
        // If the line is supported at all, its best efficiency is supported too.
        let supported = line.nodes.iter().any(|n| !n.extrapolated);
        let known = line.nodes.iter().filter(|n| !(supported && n.extrapolated));
        let best = known.max_by(|a, b| a.eta.total_cmp(&b.eta));
        let surge = line.nodes.last();
        rows.add_row(vec![
            format!("{:.0}", line.speed_corrected_rpm),
            number(surge.map(|n| n.flow_corrected_kg_s), 4),
            number(surge.map(|n| n.pressure_ratio), 3),
            number(choke_flow(line), 4),
            number(best.map(|n| 100.0 * n.eta), 1),
            number(best.map(|n| 100.0 * half_width_95(n.eta_standard_error)), 1),
            number(left_out.map(|l| 100.0 * l.distance_ratio), 2),
            number(left_out.and_then(|l| l.eta).map(|eta| 100.0 * eta), 2),
            match (line.measured, line.nodes.iter().all(|n| n.extrapolated)) {
                (true, _) if left_out.is_some_and(|l| l.outermost) => "outermost".to_owned(),
                (true, _) => "measured".to_owned(),
                (false, true) => "extrapolated".to_owned(),
                (false, false) => "between".to_owned(),
            },
        ]);
    }
    let mut text = format!("Corrected to {}. ", map.reference);
    let _ = writeln!(
        text,
        "Points lie {:.2} % (distance in flow over the line's largest flow and PR - 1 over its largest) and {:.2} points of \
         efficiency from the fit, rms; whole lines scatter by {:.1} % of flow.",
        100.0 * fitted.distance_rms_ratio,
        100.0 * fitted.eta_rms,
        100.0 * fitted.line_scatter_ratio
    );
    for (outermost, name) in [(false, "inner"), (true, "outermost")] {
        let lines = || fitted.left_out.iter().filter(move |l| l.outermost == outermost);
        let count = lines().count();
        if count == 0 {
            continue;
        }
        let mean = |sum: f64| 100.0 * sum / count as f64;
        let eta = || lines().filter_map(|l| l.eta);
        let _ = writeln!(
            text,
            "Left out, {name} lines: distance {:.2} % on average, {:.2} % at worst; efficiency {:.2} points on average, {:.2} at worst (medians of each line's points).",
            mean(lines().map(|l| l.distance_ratio).sum()),
            100.0 * lines().map(|l| l.distance_ratio).fold(0.0, f64::max),
            mean(eta().sum()),
            100.0 * eta().fold(0.0, f64::max),
        );
    }
    let points = |line: &LeftOutLine| points_of(map, line.speed_corrected_rpm);
    let coverage = |value: fn(&LeftOutLine) -> Option<f64>| {
        let (mut sum, mut count) = (0.0, 0.0);
        for line in fitted.left_out.iter().filter(|l| !l.outermost) {
            if let Some(share) = value(line) {
                (sum, count) = (sum + share * points(line), count + points(line));
            }
        }
        (count > 0.0).then(|| 100.0 * sum / count)
    };
    if let (Some(distance), Some(eta)) = (coverage(|l| l.distance_held_ratio), coverage(|l| l.eta_held_ratio))
    {
        let _ = writeln!(
            text,
            "At inner lines that were left out, the 95 % intervals contain {distance:.0} % of the points' distances and {eta:.0} % of their efficiencies."
        );
    }
    if fitted.crossings > 0 {
        let _ = writeln!(
            text,
            "{} pair(s) of neighbouring lines cross: do not use the map there; look for a line whose speed is wrong.",
            fitted.crossings
        );
    } else {
        text.push_str("No speed lines cross.\n");
    }
    format!("{rows}\n\n{}", wrapped(&text, table::COLUMNS, 2))
}

/// Points of a line, by its speed.
fn points_of(map: &CompressorMap, speed_corrected_rpm: f64) -> f64 {
    let line = map.lines.iter().find(|line| line.speed_corrected_rpm == speed_corrected_rpm);
    line.map_or(0.0, |line| line.points.len() as f64)
}

fn choke_flow(line: &FittedLine) -> Option<f64> {
    line.nodes.iter().map(|n| n.flow_corrected_kg_s).max_by(f64::total_cmp)
}
