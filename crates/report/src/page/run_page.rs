//! The frame of a page: content policy, style, scripts, data; the page of a diagnosis, which needs no more; and the page of a run or of identified
//! recordings.

use crate::diagnosis::gap_text::gap_document;
use crate::page::drawn::{DrawnMap, DrawnPoint, DrawnStep, drawn_map, drawn_points, drawn_steps};
use crate::test_report::run_report::RunReport;
use mapper_campaign::campaign::DisplayUnits;
use mapper_core::Verdict;
use mapper_diagnose::gap::Diagnosed;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde::Serialize;

const STYLE: &str = include_str!("../../assets/page.css");
/// d3 7.9.2 and Observable Plot 0.6.17 (ISC), unchanged from their npm packages: `assets/SHA256SUMS`.
const D3: &str = include_str!("../../assets/d3.min.js");
const PLOT: &str = include_str!("../../assets/plot.umd.min.js");
const COMMON: &str = include_str!("../../assets/common.js");
const MAP: &str = include_str!("../../assets/map.js");
const STEPS: &str = include_str!("../../assets/steps.js");
const TABLES: &str = include_str!("../../assets/tables.js");
const LIVE: &str = include_str!("../../assets/live.js");

/// Purpose of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To keep: it works from disk and makes no requests.
    Kept,
    /// To keep, without a script: its pictures are in it.
    Still,
    /// To watch a run: it makes requests only to the program that served it.
    Live,
}

impl Purpose {
    /// Parts of the page's own script, in order.
    fn scripts(self) -> &'static [&'static str] {
        match self {
            Purpose::Kept => &[D3, PLOT, COMMON, MAP, STEPS, TABLES],
            Purpose::Still => &[],
            Purpose::Live => &[D3, PLOT, COMMON, MAP, LIVE],
        }
    }

    fn policy(self) -> String {
        match self {
            Purpose::Still => format!("{POLICY}; script-src 'none'"),
            Purpose::Kept => format!("{POLICY}; {OWN_SCRIPT}"),
            Purpose::Live => format!("{POLICY}; {OWN_SCRIPT}; connect-src 'self'"),
        }
    }
}

/// No requests in or out.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";
const OWN_SCRIPT: &str = "script-src 'unsafe-inline'";

/// The complete page; `footer` is printed on each sheet, `data` is the input of its script.
pub(crate) fn shell(
    title: &str,
    footer: &str,
    purpose: Purpose,
    data: &impl Serialize,
    body: &Markup,
) -> Result<String, serde_json::Error> {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(purpose.policy());
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(footer_style(footer))) }
            }
            body {
                (body)
                @if purpose != Purpose::Still {
                    script type="application/json" id="data" { (PreEscaped(json_in_html(data)?)) }
                }
                @for script in purpose.scripts() { script { (PreEscaped(script)) } }
            }
        }
    };
    Ok(page.into_string())
}

/// The footer of each printed sheet, with the sheet's number and the total.
fn footer_style(footer: &str) -> String {
    // Escaped as numbers, so that no letter of a name can end a string or an element.
    let text: String = footer
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c.to_string() } else { format!("\\{:x} ", u32::from(c)) })
        .collect();
    format!(
        "@media print{{@page{{@bottom-left{{content:\"{text}\"}}@bottom-right{{content:\"sheet \" counter(page) \" of \" \
         counter(pages)}}}}}}"
    )
}

/// JSON in which no string can end the element.
fn json_in_html(data: &impl Serialize) -> Result<String, serde_json::Error> {
    Ok(serde_json::to_string(data)?
        .replace('<', "\\u003c")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029"))
}

/// The page. `machine` and `recording` are names for its title.
pub fn gap_page(machine: &str, recording: &str, diagnosed: &Diagnosed) -> Result<String, serde_json::Error> {
    let title = format!("Gap between {machine} and its nominal model");
    let body = html! {
        header { h1 { (title) } p.under { "Recording: " (recording) } }
        main #gap { (gap_document(diagnosed).html()) }
    };
    shell(&title, &title, Purpose::Still, &(), &body)
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use sha2::{Digest, Sha256};

    /// The libraries match their recorded hashes byte for byte.
    #[test]
    fn libraries_are_as_their_sums_say() {
        let sums = include_str!("../../assets/SHA256SUMS");
        for (name, text) in [("d3.min.js", D3), ("plot.umd.min.js", PLOT)] {
            let sum: String =
                Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect();
            assert!(sums.contains(&format!("{sum}  {name}")), "{name}: {sum}");
            // They must not contain the end of their element.
            assert!(!text.contains("</script"), "{name}");
        }
    }

    #[test]
    fn hostile_names_stay_text() {
        let hostile = "</script><script>alert(1)</script>";
        let page = shell(hostile, hostile, Purpose::Kept, &[hostile], &html! { h1 { (hostile) } }).unwrap();
        assert!(!page.contains("<script>alert"), "markup of a name got into the page");
        let style = page.split("<style>").nth(1).unwrap().split("</style>").next().unwrap();
        assert!(style.contains("sheet \" counter(page)"), "the name ends the style");
        let data = page.split("id=\"data\">").nth(1).unwrap().split("</script>").next().unwrap();
        assert_eq!(serde_json::from_str::<Vec<String>>(data).unwrap(), [hostile]);
    }
}
