//! Zero, drift, surge, sensors, events, doubts: what happened beside the map.

use crate::run_page::RunPage;
use mapper_campaign::campaign::DisplayUnits;
use mapper_report::{Display, doubts, repeated_jumps_text, score_text, surge_text, zero_text};
use maud::{Markup, html};

pub(crate) fn notes(page: &RunPage<'_>, units: &DisplayUnits) -> Markup {
    let report = page.report;
    let display = Display::new(units);
    let zero = zero_text(page.zero);
    let said = doubts(report.points.iter().map(|scored| &scored.point));
    html! {
        section #notes aria-labelledby="notes-head" {
            h2 #notes-head { "Notes" }
            p { (report.outcome) }
            @if !report.remarks.is_empty() { ul { @for remark in report.remarks { li { (remark) } } } }
            @if let Some(score) = report.score {
                h3 { "Against the simulator's truth" }
                (sentences(&score_text(score)))
            }
            @if !zero.trim().is_empty() { h3 { "Isothermal zero" } pre { (zero.trim()) } }
            @if !report.repeats.is_empty() {
                h3 { "Drift" }
                p { "Repeats are kept out of the map. Fixed offsets cancel in what changes between them." }
                (sentences(&repeated_jumps_text(report.repeats, &display)))
            }
            @if let Some(surge) = report.surge {
                h3 { "Surge" }
                pre { (surge_text(surge.marks, surge.remarks, surge.surges, units)) }
            }
            @if !report.sensors.is_empty() {
                h3 { "Several sensors" }
                ul { @for fused in report.sensors { li { (fused) } } }
            }
            h3 { "Doubts and remarks" }
            @if said.is_empty() { p { "None." } }
            @else { ul { @for doubt in &said { li { (doubt.steps()) " (" (doubt.code) "): " (doubt.message) } } } }
            h3 { "Events" }
            @if report.events.is_empty() { p { "None." } }
            @else { ul { @for event in report.events { li { (format!("{:.1} s", event.t_s)) ": " (event.message) } } } }
        }
    }
}

fn sentences(text: &str) -> Markup {
    html! { ul { @for line in text.lines().filter(|line| !line.trim().is_empty()) { li { (line) } } } }
}
