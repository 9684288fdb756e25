//! The page of a run or of identified recordings.

use crate::page::drawn::{DrawnMap, DrawnPoint, DrawnStep, drawn_map, drawn_points, drawn_steps};
use crate::page::shell::{Purpose, shell};
use crate::test_report::run_report::RunReport;
use mapper_campaign::campaign::DisplayUnits;
use mapper_core::Verdict;
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

impl RunReport<'_> {
    /// The report as a page: one HTML file.
    ///
    /// # Errors
    /// None in practice: JSON of numbers and strings can always be written.
    pub fn page(&self) -> Result<String, serde_json::Error> {
        let display = self.display();
        let drawn = PageData {
            units: display.units().clone(),
            points: drawn_points(self, &display),
            map: self.results.map.map(|map| drawn_map(map, &display)).unwrap_or_default(),
            steps: drawn_steps(self, &display),
            others: self
                .others
                .iter()
                .map(|other| DrawnOther { name: other.name.clone(), map: drawn_map(other.map, &display) })
                .collect(),
        };
        let (title, content) = (self.title(), self.body());
        let body = html! {
            header {
                h1 { (title) }
                div.cover { (self.cover().html()) }
                section.verdict.clean[self.verdict() == Verdict::Good] aria-labelledby="verdict" {
                    h2 #verdict { (self.verdict_sentence()) }
                    (self.summary().html())
                }
                nav aria-label="Sections" {
                    @for (id, heading) in content.contents() { a href=(format!("#{id}")) { (heading) } }
                }
            }
            main { (content.html()) }
        };
        let serial = self.campaign.and_then(|campaign| campaign.machine.serial_number.as_deref());
        let parts = [Some(title.as_str()), serial, self.tested_at, Some(self.program)];
        let footer = parts.into_iter().flatten().collect::<Vec<_>>().join(" · ");
        shell(&title, &footer, Purpose::Kept, &drawn, &body)
    }
}
