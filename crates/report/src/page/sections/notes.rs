//! Everything except the map: zero, drift, surge, sensors, events, doubts.

use crate::page::prose::{prose, sentence};
use crate::page::run_page::RunPage;
use crate::page::table::{Cell, Row, data_table, words_table};
use crate::{
    Display, SurgeReport, ZERO_HEADS, doubts, repeated_jumps_text, result_remark_text, score_text,
    surge_heads, surge_remarks, surge_rows, zero_rows, zero_words,
};
use maud::{Markup, html};

pub(crate) fn notes(page: &RunPage<'_>, display: &Display) -> Markup {
    let report = page.report;
    let zero = zero_rows(report.zero, display);
    let warnings = doubts(report.identified());
    // The others are next to the verdict.
    let remarks: Vec<_> = report.remarks.iter().filter(|remark| !remark.concerns_all_points()).collect();
    html! {
        section #notes aria-labelledby="notes-head" {
            h2 #notes-head { "Notes" }
            h3 { "Outcome" }
            p { (prose(&report.origin.sentence())) }
            @if !remarks.is_empty() { ul { @for remark in &remarks { li { (sentence(&result_remark_text(remark))) } } } }
            @if let Some(score) = report.score {
                h3 { "Comparison with the simulator's truth" }
                (sentences(&score_text(score)))
            }
            @if let Some(words) = zero_words(report.zero) {
                h3 { "Isothermal zero" }
                p { (prose(&words)) }
                @if !zero.is_empty() { (words_table("Offsets subtracted", &ZERO_HEADS, &zero)) }
            }
            @if !report.repeats.is_empty() {
                h3 { "Drift" }
                p { "Repeats are not on the map. Fixed offsets of the sensors cancel in the change from one to the next." }
                (sentences(&repeated_jumps_text(report.repeats, display)))
            }
            @if let Some(surge) = report.surge {
                h3 { "Surge" }
                (surge_part(surge, display))
            }
            @if !report.sensors.is_empty() {
                h3 { "Channels with several sensors" }
                ul { @for fused in report.sensors { li { (fused) } } }
            }
            h3 { "Warnings and remarks" }
            @if warnings.is_empty() { p { "None." } }
            @else { ul { @for doubt in &warnings { li { (doubt.steps()) " (" (doubt.code) "): " (sentence(&doubt.message())) } } } }
            h3 { "Events" }
            @if report.events.is_empty() { p { "None." } }
            @else { ul { @for event in report.events { li { (format!("{:.1} s", event.t_s)) ": " (prose(&event.message)) } } } }
        }
    }
}

fn surge_part(surge: &SurgeReport, display: &Display) -> Markup {
    let cells = |row: Vec<String>| Row { step: None, cells: row.into_iter().map(Cell::text).collect() };
    let rows: Vec<Row> = surge_rows(&surge.marks, display).into_iter().map(cells).collect();
    html! {
        (data_table("Measured surge", &surge_heads(&surge.marks, display), &rows))
        @for remark in surge_remarks(surge) { p { (remark) } }
    }
}

fn sentences(text: &str) -> Markup {
    html! { ul { @for line in text.lines().filter(|line| !line.trim().is_empty()) { li { (prose(line)) } } } }
}
