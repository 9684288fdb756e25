//! Test object, place, conditions and instruments.

use crate::page::prose::prose;
use crate::page::run_page::RunPage;
use crate::page::table::{facts, words_table};
use crate::{
    ACCEPTANCE_HEADS, BALANCE_HEADS, BALANCE_WORDS, CONDITION_HEADS, Display, INSTRUMENT_HEADS,
    INSTRUMENT_WORDS, REGISTER_HEADS, acceptance_rows, acceptance_words, balance_rows, condition_facts,
    condition_rows, instrument_rows, register_rows,
};
use maud::{Markup, html};

pub(crate) fn conditions(page: &RunPage<'_>, display: &Display) -> Markup {
    let report = page.report;
    let read = condition_rows(report.campaign, report.recording, display);
    let instruments =
        report.campaign.map(|campaign| instrument_rows(campaign, report.used, display)).unwrap_or_default();
    let register = report
        .campaign
        .map(|campaign| register_rows(campaign, report.tested_at, display))
        .unwrap_or_default();
    let judged = report.judged_points();
    let (balance, acceptance) = (balance_rows(&judged), acceptance_rows(&judged));
    html! {
        section #conditions aria-labelledby="conditions-head" {
            h2 #conditions-head { "Conditions and instruments" }
            div.beside {
                (facts("Test", &condition_facts(report)))
                @if !read.is_empty() { (words_table("Conditions read at the ends of the steps", &CONDITION_HEADS, &read)) }
            }
            @if let Some(sentence) = acceptance_words(&judged) {
                p { (prose(&sentence)) }
                (words_table("Acceptance", &ACCEPTANCE_HEADS, &acceptance))
            }
            @if !balance.is_empty() {
                details { summary { "Energy balance" }
                    p { (prose(BALANCE_WORDS)) }
                    (words_table("Energy balance", &BALANCE_HEADS, &balance))
                }
            }
            @if !instruments.is_empty() {
                div #instruments {
                    p { (prose(INSTRUMENT_WORDS)) }
                    (words_table("Instruments", &INSTRUMENT_HEADS, &instruments))
                    @if !register.is_empty() { (words_table("Calibration register", &REGISTER_HEADS, &register)) }
                }
            }
        }
    }
}
