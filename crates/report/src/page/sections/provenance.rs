//! Inputs and programs behind the numbers.

use crate::page::run_page::RunPage;
use crate::page::table::facts;
use crate::{duration, provenance_facts};
use maud::{Markup, html};

pub(crate) fn provenance(page: &RunPage<'_>) -> Markup {
    let sources: Vec<(&str, String)> = page
        .report
        .sources
        .iter()
        .map(|source| {
            (source.file.as_str(), format!("{}, {} steps", duration(source.duration_s), source.steps))
        })
        .collect();
    html! {
        section #provenance aria-labelledby="provenance-head" {
            h2 #provenance-head { "Provenance" }
            (facts("How the numbers were made", &provenance_facts(page.report)))
            @if !sources.is_empty() { (facts("Recordings", &sources)) }
        }
    }
}
