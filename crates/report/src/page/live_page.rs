//! The page of a run in progress: the same map, updated by the program during the run.

use crate::Display;
use crate::page::drawn_map::{DrawnMap, drawn_map};
use crate::page::drawn_points::{DrawnPoint, drawn_point};
use crate::page::sections::live;
use crate::page::shell::{Purpose, shell};
use mapper_campaign::Campaign;
use mapper_campaign::units::Kind;
use mapper_core::{IdentifiedPoint, Plan};
use mapper_maps::assemble;
use serde::Serialize;

/// Initial data of the script.
#[derive(Serialize)]
struct Empty {
    units: EmptyUnits,
    points: [(); 0],
    map: DrawnMap,
    others: [(); 0],
    lines: [(); 0],
    planned: [(); 0],
}

#[derive(Serialize)]
struct EmptyUnits {
    flow: &'static str,
    speed: &'static str,
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
///
/// # Errors
/// None in practice: JSON of numbers and strings can always be written.
pub fn live_page() -> Result<String, serde_json::Error> {
    let empty = Empty {
        units: EmptyUnits { flow: "", speed: "" },
        points: [],
        map: DrawnMap::default(),
        others: [],
        lines: [],
        planned: [],
    };
    shell("A run of mapper, live", "A run of mapper, live", Purpose::Live, &empty, &live::live())
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
