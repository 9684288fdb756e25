//! The page of a run in progress: the same map, updated by the program during the run.

use crate::formatting::Display;
use crate::page::drawn::{DrawnMap, DrawnPoint, drawn_map, drawn_point};
use crate::page::run_page::{Purpose, shell};
use mapper_campaign::Campaign;
use mapper_campaign::units::Kind;
use mapper_core::{IdentifiedPoint, Plan};
use mapper_maps::assemble;
use maud::{Markup, html};
use serde::Serialize;
use serde_json::json;

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

/// The map of the points so far: contours between lines that have two points each, by the mesh of the finished map. Empty
/// if there is none yet.
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
