//! The surge-side ends that were sought, in words and as a table.

use crate::display::Display;
use crate::markdown::{self, Align};
use crate::number::{number, percent};
use mapper_campaign::campaign::DisplayUnits;
use mapper_core::{SurgeFoundBy, SurgeMark, half_width_95};
use mapper_record::score::ScoredMark;
use std::fmt::Write;

/// Marks of a search for surge, what it did not find, and how often the compressor surged; Markdown.
pub fn surge_text(marks: &[ScoredMark], remarks: &[String], surges: usize, units: &DisplayUnits) -> String {
    let display = Display::new(units);
    let with_truth = marks.iter().any(|scored| scored.truth_flow_corrected_kg_s.is_some());
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
    if with_truth {
        heads.push("off the truth, %".to_owned());
    }
    let rows: Vec<Vec<String>> = marks
        .iter()
        .map(|ScoredMark { mark, truth_flow_corrected_kg_s }| {
            let flow_kg_s = mark.flow_corrected_kg_s;
            let mut row = vec![
                display.speed(mark.speed_corrected_rpm),
                display.flow(flow_kg_s),
                percent(Some(half_width_95(mark.flow_total_standard_error_kg_s()) / flow_kg_s), 1),
                number(Some(mark.pressure_ratio), 3),
                number(Some(half_width_95(mark.pressure_ratio_standard_error)), 3),
                percent(Some(mark.closest_flow_corrected_kg_s / flow_kg_s - 1.0), 1),
                mark.steps.to_string(),
                found_by(mark).to_owned(),
            ];
            if with_truth {
                row.push(percent(truth_flow_corrected_kg_s.map(|truth| flow_kg_s / truth - 1.0), 2));
            }
            row
        })
        .collect();
    let mut text = markdown::table(&heads, Align::Right, &rows);
    let times = match surges {
        0 => "The compressor did not go into surge on the way.".to_owned(),
        1 => "The compressor went into surge once on the way; the valve opened at once.".to_owned(),
        more => format!("The compressor went into surge {more} times on the way; the valve opened at once."),
    };
    let _ = writeln!(text, "\n{times}");
    for remark in remarks {
        let _ = writeln!(text, "\nNot found at {remark}.");
    }
    text
}

fn found_by(mark: &SurgeMark) -> &'static str {
    match mark.found_by {
        SurgeFoundBy::Precursor => "variation",
        SurgeFoundBy::Surge => "surge",
    }
}
