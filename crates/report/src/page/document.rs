//! The page as HTML.

use crate::page::drawn_map::{DrawnMap, drawn_map};
use crate::page::drawn_points::{DrawnPoint, drawn_points};
use crate::page::drawn_steps::{DrawnStep, drawn_steps};
use crate::page::run_page::RunPage;
use crate::page::sections;
use crate::page::shell::{Purpose, shell};
use mapper_campaign::campaign::DisplayUnits;
use maud::html;
use serde::Serialize;

/// Data of the script.
#[derive(Serialize)]
struct PageData {
    units: DisplayUnits,
    points: Vec<DrawnPoint>,
    map: DrawnMap,
    steps: Vec<DrawnStep>,
    others: Vec<DrawnOther>,
}

#[derive(Serialize)]
struct DrawnOther {
    name: String,
    map: DrawnMap,
}

/// The page as HTML.
///
/// # Errors
/// None in practice: JSON of numbers and strings can always be written.
pub fn run_page(page: &RunPage<'_>) -> Result<String, serde_json::Error> {
    let report = page.report;
    let display = report.display();
    let drawn = PageData {
        units: display.units().clone(),
        points: drawn_points(page, &display),
        map: page.report.map.map(|map| drawn_map(map, &display)).unwrap_or_default(),
        steps: drawn_steps(page, &display),
        others: page
            .others
            .iter()
            .map(|other| DrawnOther { name: other.name.clone(), map: drawn_map(other.map, &display) })
            .collect(),
    };
    let body = html! {
        (sections::head::head(page))
        main {
            (sections::map::map(page))
            (sections::step::step(page, &display))
            (sections::conditions::conditions(page, &display))
            (sections::points::points(page, &display))
            (sections::plan::plan(page, &display))
            @if let Some(diagnosis) = &page.gap {
                section #gap aria-labelledby="gap-head" {
                    h2 #gap-head { "Gap to the nominal model" }
                    (diagnosis)
                }
            }
            (sections::notes::notes(page, &display))
            (sections::provenance::provenance(page))
        }
    };
    let title = format!("Compressor map of {}", report.machine);
    let serial = report.campaign.and_then(|campaign| campaign.machine.serial_number.as_deref());
    let parts = [Some(title.as_str()), serial, report.tested_at, Some(report.program)];
    let footer = parts.into_iter().flatten().collect::<Vec<_>>().join(" · ");
    shell(&title, &footer, Purpose::Kept, &drawn, &body)
}
