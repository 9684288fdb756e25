//! Measured surge-side ends, in words and as a table.

use crate::formatting::display::Display;
use crate::formatting::markdown::{self, Align};
use crate::formatting::number::{number, percent};
use crate::formatting::table::{COLUMNS, with_heads};
use crate::formatting::wrapped::wrapped;
use mapper_core::{SurgeFoundBy, SurgeMark, SurgeNotFound, half_width_95};
use mapper_recording::score::ScoredMark;
use serde::Serialize;

/// Result of the search for surge.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SurgeReport {
    /// The marks in order of speed, with the truth if the recording contains it.
    pub marks: Vec<ScoredMark>,
    /// Lines on which no mark was found.
    pub remarks: Vec<SurgeNotFound>,
    /// How often the compressor went into surge.
    pub surges: usize,
}

/// Marks of a search for surge, lines without a mark, and the number of surge events; Markdown.
pub fn surge_text(surge: &SurgeReport, display: &Display) -> String {
    let (heads, rows) = (surge_heads(&surge.marks, display), surge_rows(&surge.marks, display));
    let table = markdown::table(&heads, Align::Right, rows);
    let remarks_text: String = surge_remarks(surge).iter().map(|remark| format!("\n{remark}\n")).collect();
    format!("{table}{remarks_text}")
}

/// The number of surge events, and the lines without a mark, a sentence each.
pub fn surge_remarks(surge: &SurgeReport) -> Vec<String> {
    std::iter::once(times(surge.surges))
        .chain(surge.remarks.iter().map(|SurgeNotFound { target_speed_rpm, openings, enough }| match enough {
            true => format!(
                "Not found at {target_speed_rpm:.0} rpm: the variation of pressures and flow did not grow over {openings} openings."
            ),
            false => format!(
                "Not found at {target_speed_rpm:.0} rpm: {openings} openings are too few to locate surge."
            ),
        }))
        .collect()
}

/// Columns of [`surge_rows`].
pub fn surge_heads(marks: &[ScoredMark], display: &Display) -> Vec<String> {
    let mut heads = vec![
        display.speed_head("corrected speed"),
        display.flow_head("surge flow, corrected"),
        "+/- % (95 %)".to_owned(),
        "PR".to_owned(),
        "+/- (95 %)".to_owned(),
        "nearest point above it, %".to_owned(),
        "openings".to_owned(),
        "found by".to_owned(),
    ];
    if with_truth(marks) {
        heads.push("error, %".to_owned());
    }
    heads
}

/// The same for a terminal of 80 columns. `truth`: whether to show the deviations of the marks from it.
pub fn surge_columns_text(surge: &SurgeReport, display: &Display, truth: bool) -> String {
    let shown = |scored: &ScoredMark| {
        if truth { *scored } else { ScoredMark { truth_flow_corrected_kg_s: None, ..*scored } }
    };
    let marks: Vec<ScoredMark> = surge.marks.iter().map(shown).collect();
    let marks = marks.as_slice();
    let units = display.units();
    let mut heads = [&units.speed, &units.flow, "+/- %", "PR", "+/-", "nearest %", "openings", "found by"]
        .map(str::to_owned)
        .to_vec();
    if with_truth(marks) {
        heads.push("error %".to_owned());
    }
    let mut table = with_heads(&heads);
    for row in surge_rows(marks, display) {
        table.add_row(row);
    }
    let words = "Surge-side ends of the lines: corrected speed and flow, half widths of 95 % intervals, distance of the nearest \
                 point above in flow, number of openings tried.";
    let mut text = format!("{}\n{table}\n\n", wrapped(words, COLUMNS, 0));
    if with_truth(marks) {
        text.push_str("error: difference from the simulator's truth.\n");
    }
    for remark in surge_remarks(surge) {
        text.push_str(&wrapped(&remark, COLUMNS, 2));
    }
    text
}

fn with_truth(marks: &[ScoredMark]) -> bool {
    marks.iter().any(|scored| scored.truth_flow_corrected_kg_s.is_some())
}

/// A row for each mark, in order of speed.
pub fn surge_rows(marks: &[ScoredMark], display: &Display) -> Vec<Vec<String>> {
    let row = |ScoredMark { mark, truth_flow_corrected_kg_s }: &ScoredMark| {
        let flow_kg_s = mark.flow_corrected_kg_s;
        let mut row = vec![
            display.speed(mark.speed_corrected_rpm),
            display.flow(flow_kg_s),
            percent(Some(half_width_95(mark.flow_total_standard_error_kg_s()) / flow_kg_s), 1),
            number(Some(mark.pressure_ratio), 3),
            number(Some(half_width_95(mark.pressure_ratio_standard_error)), 3),
            percent(Some(mark.closest_flow_corrected_kg_s / flow_kg_s - 1.0), 1),
            mark.steps.to_string(),
            evidence_name(mark).to_owned(),
        ];
        if with_truth(marks) {
            row.push(percent(truth_flow_corrected_kg_s.map(|truth| flow_kg_s / truth - 1.0), 2));
        }
        row
    };
    marks.iter().map(row).collect()
}

fn times(surges: usize) -> String {
    match surges {
        0 => "The compressor did not go into surge during the approach.".to_owned(),
        1 => "The compressor went into surge once during the approach; the valve opened immediately."
            .to_owned(),
        more => format!(
            "The compressor went into surge {more} times during the approach; the valve opened immediately."
        ),
    }
}

fn evidence_name(mark: &SurgeMark) -> &'static str {
    match mark.found_by {
        SurgeFoundBy::Precursor => "variation",
        SurgeFoundBy::Surge => "surge",
    }
}
