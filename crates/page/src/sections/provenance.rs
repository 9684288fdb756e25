//! Conditions, instruments, and what the numbers were made from.

use crate::run_page::RunPage;
use crate::table::facts;
use mapper_report::{duration, head_rows};
use maud::{Markup, html};

pub(crate) fn provenance(page: &RunPage<'_>) -> Markup {
    let report = page.report;
    let mut rows: Vec<(String, String)> =
        head_rows(report).into_iter().map(|(what, value)| (what.to_owned(), value)).collect();
    rows.push(("tested".to_owned(), page.tested_at.unwrap_or("not stated").to_owned()));
    rows.push(("program".to_owned(), page.program.to_owned()));
    let calibration: Vec<(String, String)> = report
        .campaign
        .into_iter()
        .flat_map(|campaign| &campaign.report.calibration)
        .map(|(channel, day)| (format!("{channel} ({})", channel.info().description), day.to_string()))
        .collect();
    let sources: Vec<(String, String)> = report
        .sources
        .iter()
        .map(|source| {
            (source.file.clone(), format!("{}, {} steps", duration(source.duration_s), source.steps))
        })
        .collect();
    html! {
        section #provenance aria-labelledby="provenance-head" {
            h2 #provenance-head { "Provenance" }
            (facts("Conditions and origin", &rows))
            @if !calibration.is_empty() { (facts("Last calibration of the instruments", &calibration)) }
            @if !sources.is_empty() { (facts("Recordings", &sources)) }
        }
    }
}
