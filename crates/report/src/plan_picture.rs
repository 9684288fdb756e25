//! The path through the map: conventional mapping beside the plan, as in figure 13 of the paper.

use mapper_campaign::Campaign;
use mapper_chart::{Annotation, Axis, Colour, Figure, Line, Panel, Scatter, TextAnchor};
use mapper_core::{OperatingPoint, Plan, StepKind, VisitOrder};
use mapper_physics::model::Model;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::steady::hold_speed;
use mapper_planner::{Comparison, WayOfMapping};

const MAP: Colour = Colour(0xB0, 0xB0, 0xB0);
const CONVENTIONAL: Colour = Colour(0xB4, 0x53, 0x09);
const PROPOSED: Colour = Colour(0x1D, 0x4E, 0x89);

/// Steps that carry their number: more would cover the map.
const NUMBERED_STEPS: usize = 80;
/// Jumps that are drawn strongly.
const FIRST_JUMPS: usize = 10;
/// How much of the colour is left for all others.
const LATER_TINT: f64 = 0.6;

/// Both paths side by side, as SVG.
pub fn plan_svg(campaign: &Campaign, model: &Model, plan: &Plan, comparison: &Comparison) -> String {
    let place = |point: OperatingPoint| {
        let boundary =
            BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..campaign.boundary };
        // The plan has held every point before.
        hold_speed(model, point.speed_rpm, &boundary).map_or((f64::NAN, f64::NAN), |steady| {
            (1e3 * steady.outputs.flow_corrected_kg_s, steady.outputs.pressure_ratio)
        })
    };
    let proposed: Vec<OperatingPoint> = plan.steps.iter().map(|step| step.to).collect();
    let repeats: Vec<(f64, f64)> =
        plan.steps.iter().filter(|step| step.kind == StepKind::Repeat).map(|step| place(step.to)).collect();
    let conventional = panel(
        campaign,
        &format!("(a) conventional: {}", numbers(&comparison.conventional)),
        CONVENTIONAL,
        &comparison.conventional.order,
        &place,
    );
    let mut planned = panel(
        campaign,
        &format!("(b) {}: {}", plan.objective, numbers(&comparison.proposed)),
        PROPOSED,
        &proposed,
        &place,
    );
    if !repeats.is_empty() {
        planned.add(Scatter::new(repeats, PROPOSED).hollow().size_px(14.0).label("repeats for drift"));
    }
    Figure::new(format!("{}: path through the map", plan.campaign))
        .subtitle(format!(
            "Errors of the efficiency as predicted on the nominal machine: rms, worst. Along speed lines with the plan's method: {}.",
            comparison.of_order(VisitOrder::SpeedLines.name()).map_or_else(|| "-".to_owned(), numbers)
        ))
        .panel(conventional)
        .panel(planned)
        .panel_size_px(620.0, 480.0)
        .to_svg()
}

fn numbers(way: &WayOfMapping) -> String {
    let percent =
        |error: Option<f64>| error.map_or_else(|| "-".to_owned(), |error| format!("{:.2}", 100.0 * error));
    format!(
        "{:.0} min, {} / {} %points",
        way.minutes,
        percent(way.rms_error_eta),
        percent(way.worst_error_eta)
    )
}

fn panel(
    campaign: &Campaign,
    title: &str,
    colour: Colour,
    path: &[OperatingPoint],
    place: &impl Fn(OperatingPoint) -> (f64, f64),
) -> Panel {
    // Room for the names of the speed lines at their ends.
    let widest = campaign.points.iter().map(|point| place(*point).0).fold(0.0, f64::max);
    let flow = Axis::new("corrected flow, g/s").range(0.0, 1.15 * widest);
    let mut panel = Panel::new(flow, Axis::new("pressure ratio P2/P1")).title(title);
    let mut speeds: Vec<f64> = campaign.points.iter().map(|point| point.speed_rpm).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    for speed_rpm in &speeds {
        let mut line: Vec<(f64, f64)> =
            campaign.points.iter().filter(|point| point.speed_rpm == *speed_rpm).map(|p| place(*p)).collect();
        line.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(end) = line.last() {
            let text = format!("{:.0} krpm", speed_rpm / 1e3);
            panel.add(Annotation { colour: Colour(0x70, 0x70, 0x70), ..Annotation::new(text, *end) });
        }
        panel.add(Line::new(line, MAP).width_px(1.2).label("speed lines"));
    }
    let places: Vec<(f64, f64)> = path.iter().map(|point| place(*point)).collect();
    let first = places.len().min(FIRST_JUMPS + 1);
    // What comes later must not hide where the path begins.
    if places.len() > first {
        let later = places[first - 1..].to_vec();
        panel.add(Line::new(later, colour.tint(LATER_TINT)).width_px(0.8).arrows().label("later jumps"));
    }
    let label = if places.len() > first { format!("first {FIRST_JUMPS} jumps") } else { "path".to_owned() };
    panel.add(Line::new(places[..first].to_vec(), colour).width_px(1.6).arrows().label(label));
    panel.add(Scatter::new(places.clone(), colour).size_px(5.0));
    // Each point carries the number of the step that comes to it first.
    for (step, at) in places.iter().enumerate() {
        if places.len() <= NUMBERED_STEPS && !path[..step].contains(&path[step]) {
            let number = Annotation::new((step + 1).to_string(), *at);
            panel.add(Annotation { shift_px: (-4.0, 9.0), anchor: TextAnchor::End, colour, ..number });
        }
    }
    panel
}
