//! A map of steady points as text: the lines with their ends, and the uncertainty by source.

use crate::formatting::number::number;
use crate::formatting::table;
use mapper_core::EndEvidence;
use mapper_core::{CompressorMap, EstimateUncertainty, MapPoint, PointBudgets, half_width_95};
use mapper_maps::{DetectedEnd, LineEnds};
use std::fmt::Write;

/// Lines, ends, sources of uncertainty, and remarks.
pub fn reduced_text(
    map: &CompressorMap,
    ends: &[LineEnds],
    budgets: &[PointBudgets],
    remarks: &[String],
) -> String {
    let heads =
        ["corrected rpm", "points", "best eta %", "+/- points", "surge kg/s", "by", "choke kg/s", "by"];
    let mut lines = table::with_heads(&heads.map(str::to_owned));
    for (line, ends) in map.lines.iter().zip(ends) {
        let with_eta = line.points.iter().filter_map(|point| Some((point, point.eta?)));
        let best: Option<(&MapPoint, f64)> = with_eta.max_by(|a, b| a.1.total_cmp(&b.1));
        let width = best
            .and_then(|(point, _)| point.identified.eta_uncertainty)
            .map(|error: EstimateUncertainty| 100.0 * half_width_95(error.combined_standard_error()));
        let flow = |end: &DetectedEnd| number(Some(end.flow_corrected_kg_s), 4);
        lines.add_row(vec![
            format!("{:.0}", line.speed_corrected_rpm),
            line.points.len().to_string(),
            number(best.map(|(_, eta)| 100.0 * eta), 1),
            number(width, 2),
            flow(&ends.surge),
            evidence_text(ends.surge.by).to_owned(),
            flow(&ends.choke),
            evidence_text(ends.choke.by).to_owned(),
        ]);
    }
    let mut text = format!("{lines}\n\nCorrected to {}.\n", map.reference);
    text.push_str(&sources_text(budgets));
    for remark in remarks {
        let _ = writeln!(text, "{remark}");
    }
    text
}

fn evidence_text(evidence: EndEvidence) -> &'static str {
    match evidence {
        EndEvidence::Named => "named",
        EndEvidence::ZeroSlope => "zero slope",
        EndEvidence::Efficiency => "eta 58 %",
        EndEvidence::Vertical => "vertical",
        EndEvidence::NotReached => "not reached",
    }
}

/// The contribution of each source to the efficiency: median and largest of all points.
fn sources_text(budgets: &[PointBudgets]) -> String {
    let rows = || budgets.iter().filter_map(|point| point.eta.as_ref()).flat_map(|budget| &budget.rows);
    let mut names: Vec<&str> = Vec::new();
    for row in rows().filter(|row| row.contribution != 0.0) {
        if !names.contains(&row.source.as_str()) {
            names.push(&row.source);
        }
    }
    if names.is_empty() {
        return String::new();
    }
    let heads = ["source", "median, points", "largest, points"];
    let mut table = table::with_heads(&heads.map(str::to_owned));
    for name in names {
        let mut sizes: Vec<f64> =
            rows().filter(|row| row.source == name).map(|row| 100.0 * row.contribution.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let cell = |size: Option<&f64>| number(size.copied(), 3);
        table.add_row(vec![name.to_owned(), cell(sizes.get(sizes.len() / 2)), cell(sizes.last())]);
    }
    format!("\nUncertainty of the efficiency by source, one standard deviation:\n\n{table}\n\n")
}
