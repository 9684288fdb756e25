//! The page of a run, and the live one.

use crate::diagnosis::gap_text::gap_document;
use crate::formatting::Display;
use crate::page::drawn::{
    DrawnMap, DrawnPoint, DrawnStep, drawn_map, drawn_point, drawn_points, drawn_steps,
};
use crate::test_report::run_report::RunReport;
use mapper_campaign::Campaign;
use mapper_campaign::campaign::DisplayUnits;
use mapper_campaign::units::Kind;
use mapper_core::{IdentifiedPoint, Plan, Verdict};
use mapper_diagnose::gap::{Diagnosed, Evidence};
use mapper_maps::assemble;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde::Serialize;
use serde_json::json;

const STYLE: &str = include_str!("../../assets/page.css");
/// d3 7.9.2 and Observable Plot 0.6.17 (ISC), unchanged from their npm packages: `assets/SHA256SUMS`.
const D3: &str = include_str!("../../assets/d3.min.js");
const PLOT: &str = include_str!("../../assets/plot.umd.min.js");
const COMMON: &str = include_str!("../../assets/common.js");
const MAP: &str = include_str!("../../assets/map.js");
const STEPS: &str = include_str!("../../assets/steps.js");
const TABLES: &str = include_str!("../../assets/tables.js");
const LIVE: &str = include_str!("../../assets/live.js");
/// Takes the token behind the `#`, which no request carries.
const SIGN_IN: &str = "const token = new URLSearchParams(location.hash.slice(1)).get('token');
if (token) { const form = document.forms[0]; history.replaceState(null, '', '/'); form.elements.token.value = token; form.submit(); }";

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To keep: it works from disk and makes no requests.
    Kept,
    /// To keep, without a script: its pictures are in it.
    Still,
    /// To watch a run: it makes requests only to the program that served it.
    Live,
    /// A page of the workbench, without a script: its forms go to the program that served it.
    Studio,
    /// Where the workbench asks for its token.
    SignIn,
}

impl Purpose {
    fn scripts(self) -> &'static [&'static str] {
        match self {
            Purpose::Kept => &[D3, PLOT, COMMON, MAP, STEPS, TABLES],
            Purpose::Still | Purpose::Studio => &[],
            Purpose::SignIn => &[SIGN_IN],
            Purpose::Live => &[D3, PLOT, COMMON, MAP, LIVE],
        }
    }

    fn policy(self) -> String {
        match self {
            Purpose::Still => format!("{POLICY}; {NO_FORM}; script-src 'none'"),
            Purpose::Kept => format!("{POLICY}; {NO_FORM}; {OWN_SCRIPT}"),
            Purpose::Live => format!("{POLICY}; {NO_FORM}; {OWN_SCRIPT}; connect-src 'self'"),
            Purpose::Studio => format!("{POLICY}; form-action 'self'; script-src 'none'"),
            Purpose::SignIn => format!("{POLICY}; form-action 'self'; {OWN_SCRIPT}"),
        }
    }
}

/// No requests in or out.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'";
const NO_FORM: &str = "form-action 'none'";
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
                @if !matches!(purpose, Purpose::Still | Purpose::Studio) {
                    script type="application/json" id="data" { (PreEscaped(json_in_html(data)?)) }
                }
                @for script in purpose.scripts() { script { (PreEscaped(script)) } }
            }
        }
    };
    Ok(page.into_string())
}

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

fn json_in_html(data: &impl Serialize) -> Result<String, serde_json::Error> {
    Ok(serde_json::to_string(data)?
        .replace('<', "\\u003c")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029"))
}

/// The page. `machine` and `recording` are names for its title.
pub fn gap_page(
    machine: &str,
    recording: &str,
    diagnosed: &Diagnosed,
    evidence: &Evidence,
) -> Result<String, serde_json::Error> {
    let title = format!("Gap between {machine} and its nominal model");
    let body = html! {
        header { h1 { (title) } p.under { "Recording: " (recording) } }
        main #gap { (gap_document(diagnosed, evidence).html()) }
    };
    shell(&title, &title, Purpose::Still, &(), &body)
}

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
            units: display.units.clone(),
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

/// A point in the form of the page's script.
#[derive(Debug, Clone, Serialize)]
#[serde(transparent)]
pub struct LivePoint(DrawnPoint);

/// The map so far in the form of the page's script: speed lines and contours.
#[derive(Debug, Clone, Default, Serialize)]
#[serde(transparent)]
pub struct LiveMap(DrawnMap);

/// Expected position of a point on the map, in display units.
#[derive(Debug, Clone, Serialize)]
pub struct Planned {
    flow: f64,
    pr: f64,
}

/// The page, without any data of a run: authorised clients receive those later.
pub fn live_page() -> Result<String, serde_json::Error> {
    let empty = json!({
        "units": {"flow": "", "speed": ""}, "map": DrawnMap::default(),
        "points": [], "others": [], "lines": [], "planned": [],
    });
    shell("A run of mapper, live", "A run of mapper, live", Purpose::Live, &empty, &live())
}

/// A single identified point, on the line of its target.
pub fn live_point(point: &IdentifiedPoint, campaign: &Campaign, display: &Display) -> LivePoint {
    let speed_rpm = point.target.map_or(point.speed_rpm, |target| target.speed_rpm);
    LivePoint(drawn_point(point, target_line_name(speed_rpm, campaign, display), None, display))
}

/// The name of the speed line of a target: its speed corrected with the campaign's T1, as the grid has it.
pub fn target_line_name(speed_rpm: f64, campaign: &Campaign, display: &Display) -> String {
    display.line_name(campaign.reference.corrected_speed_rpm(speed_rpm, campaign.boundary.t1_k))
}

/// The map of the points so far: contours between lines of two points or more, by the mesh of the finished map. Empty if there is none.
pub fn live_map(points: &[IdentifiedPoint], campaign: &Campaign, display: &Display) -> LiveMap {
    let Some(first) = points.first() else { return LiveMap::default() };
    let (machine, reference) = (&campaign.machine.name, campaign.reference);
    let map = assemble(points, machine, reference, first.method);
    LiveMap(map.map(|map| drawn_map(&map, display)).unwrap_or_default())
}

/// Expected positions of the plan's points.
pub fn planned(campaign: &Campaign, plan: &Plan, display: &Display) -> Vec<Planned> {
    let (t1_k, p1_pa) = (campaign.boundary.t1_k, campaign.boundary.p1_pa);
    let steps = plan.steps.iter().filter(|step| step.kind.measures());
    steps
        .map(|step| {
            let flow_kg_s = campaign.reference.corrected_flow_kg_s(step.predicted.flow_kg_s, t1_k, p1_pa);
            Planned { flow: display.number(Kind::MassFlow, flow_kg_s), pr: step.predicted.pressure_ratio }
        })
        .collect()
}

/// Buttons: request, label, confirmation question.
const BUTTONS: [(&str, &str, &str); 4] = [
    ("hold", "Hold", "Stay at this step until the operator continues?"),
    ("go-on", "Resume", "Let the held step end as planned?"),
    (
        "stop",
        "Stop at the end of the step",
        "Stop the run at the end of this step, and identify the measured steps?",
    ),
    ("safe", "Safe state", "Bring the rig into its safe state now? The step that is under way is lost."),
];

fn live() -> Markup {
    html! {
        header {
            h1 #title { "Run" }
            p #connection role="status" { "Connecting." }
        }
        main {
            section.verdict #now aria-labelledby="phase" {
                h2 #phase { "-" }
                progress #bar max="1" value="0" aria-label="share of the planned rig time" {}
                p #where {}
                p #left {}
                div.buttons {
                    @for (ask, words, question) in BUTTONS {
                        button type="button" data-ask=(ask) data-question=(question) disabled { (words) }
                    }
                }
            }
            dialog #sure aria-labelledby="question" {
                p #question {}
                div.buttons {
                    button type="button" #yes { "Yes" }
                    button type="button" #no { "No" }
                }
            }
            section aria-labelledby="map-head" {
                h2 #map-head { "Map so far" }
                p { "Rings: expected points. Each point is preliminary: it is identified by itself at the end of its step, before the zero is subtracted. At the end of the \
                     run all points are identified together, with narrower intervals and final verdicts." }
                fieldset.layers.screen {
                    legend { "Show" }
                    @for (name, words) in [("lines", "speed lines"), ("contours", "efficiency contours"), ("intervals", "95 % intervals"), ("repeats", "repeats")] {
                        label { input type="checkbox" name="layer" value=(name) checked[name != "repeats"]; " " (words) }
                    }
                    button type="button" id="whole" { "Reset zoom" }
                }
                div.plots {
                    figure { div #map-plot {} figcaption { "Pressure ratio over corrected flow." } }
                    figure { div #eta-plot {} figcaption { "Efficiency over corrected flow." } }
                }
            }
            section aria-labelledby="traces-head" {
                h2 #traces-head { "The last minutes" }
                div.plots #traces {}
            }
            section aria-labelledby="readings-head" {
                h2 #readings-head { "Readings and their limits" }
                div.scroll tabindex="0" role="region" aria-label="Readings and their limits" {
                    table.data.words {
                        thead { tr { @for head in ["channel", "reads", "unit", "state", "min", "max", "description"] { th scope="col" { (head) } } } }
                        tbody #readings {}
                    }
                }
            }
            section aria-labelledby="points-head" {
                h2 #points-head { "Points so far" }
                div.scroll tabindex="0" role="region" aria-label="Points so far" {
                    table.data.remarks {
                        thead {
                            tr {
                                th scope="col" { "step" }
                                th scope="col" #speed-head { "speed" }
                                th scope="col" #flow-head { "flow" }
                                @for head in ["PR", "eta %", "+/-", "h W/(m2 K)", "verdict", "why"] { th scope="col" { (head) } }
                            }
                        }
                        tbody #points {}
                    }
                }
            }
            section aria-labelledby="events-head" {
                h2 #events-head { "Events" }
                ol #events reversed {}
            }
        }
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
