//! Test object, place, conditions and instruments.

use crate::page::prose::prose;
use crate::page::run_page::RunPage;
use crate::page::table::{facts, words_table};
use crate::{
    CONDITION_HEADS, Display, INSTRUMENT_HEADS, INSTRUMENT_WORDS, condition_facts, condition_rows,
    instrument_rows,
};
use maud::{Markup, html};

pub(crate) fn conditions(page: &RunPage<'_>, display: &Display) -> Markup {
    let report = page.report;
    let read = condition_rows(report.campaign, report.recording, display);
    let instruments =
        report.campaign.map(|campaign| instrument_rows(campaign, report.used, display)).unwrap_or_default();
    html! {
        section #conditions aria-labelledby="conditions-head" {
            h2 #conditions-head { "Conditions and instruments" }
            div.beside {
                (facts("Test", &condition_facts(report)))
                @if !read.is_empty() { (words_table("Conditions read at the ends of the steps", &CONDITION_HEADS, &read)) }
            }
            @if !instruments.is_empty() {
                div #instruments {
                    p { (prose(INSTRUMENT_WORDS)) }
                    (words_table("Instruments", &INSTRUMENT_HEADS, &instruments))
                }
            }
        }
    }
}
