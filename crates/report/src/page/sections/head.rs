//! Verdict and the most important actions.

use crate::page::advice::{is_clean, recommended_actions};
use crate::page::prose::sentence;
use crate::page::run_page::RunPage;
use crate::{cover_facts, key_figures, result_remark_text, verdict_sentence};
use maud::{Markup, html};

pub(crate) fn head(page: &RunPage<'_>) -> Markup {
    let report = page.report;
    let (clean, actions) = (is_clean(page), recommended_actions(report));
    let premises = report.remarks.iter().filter(|remark| remark.concerns_all_points());
    html! {
        header {
            h1 { "Compressor map of " (report.machine) }
            dl.cover { @for (what, value) in cover_facts(report) { div { dt { (what) } dd { (value) } } } }
            p.under {
                @if report.score.is_some() { strong { "Simulated rig: nothing was measured on a real machine." } " " }
                "Efficiency is isentropic, total to total (" (report.gases.compressor.efficiency.description()) "); corrected to " (report.reference) "; method " (report.method) "."
            }
            section.verdict.clean[clean] aria-labelledby="verdict" {
                h2 #verdict { (verdict_sentence(report.identified())) }
                @for premise in premises { p { strong { (sentence(&result_remark_text(premise))) } } }
                @if let Some(figures) = key_figures(report.map, report.points, report.campaign, report.plan) { p { (figures) } }
                @if actions.is_empty() && clean {
                    p { "Nothing needs attention before the map is used." }
                }
                @if !actions.is_empty() {
                    p { "Before the map is used:" }
                    ul { @for action in &actions { li { (sentence(action)) } } }
                }
            }
            nav aria-label="Sections" {
                @for (to, name) in [("map", "Map"), ("step", "Transient of a point"), ("conditions", "Conditions and instruments"), ("points", "Points"), ("plan", "Executed plan"),
                    ("gap", "Gap"), ("notes", "Notes"), ("provenance", "Provenance")] {
                    @if to != "gap" || page.gap.is_some() { a href=(format!("#{to}")) { (name) } }
                }
            }
        }
    }
}
