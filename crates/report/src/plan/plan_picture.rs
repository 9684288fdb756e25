//! Figure 13 of the paper for a campaign: (a) its points along speed lines, (b) in the planned order.

use mapper_campaign::Campaign;
use mapper_chart::{Annotation, Axis, Colour, Figure, Line, Panel, PointLabels, Scatter};
use mapper_core::{OperatingPoint, Plan, StepKind, step_number};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::hold_speed;

const MAP: Colour = Colour(0xC8, 0xC8, 0xC8);
const MAP_TEXT: Colour = Colour(0x80, 0x80, 0x80);
const SPEED_LINES: Colour = Colour(0xB4, 0x53, 0x09);
const PLANNED: Colour = Colour(0x1D, 0x4E, 0x89);
const FIRST: Colour = Colour(0x15, 0x80, 0x3D);

/// Plans with more steps than the first number show only every fifth number, those with more than the second every tenth.
const ALL_NUMBERED: usize = 60;
const FIFTH_NUMBERED: usize = 150;

/// Both orders next to each other, as SVG; `along_lines` is the plan along speed lines, `None` if the limits allow none.
pub fn plan_svg(campaign: &Campaign, model: &Model, plan: &Plan, along_lines: Option<&Plan>) -> String {
    let place = |point: OperatingPoint| {
        let boundary =
            BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..campaign.boundary };
        // The plan has reached every point already.
        hold_speed(model, point.speed_rpm, &boundary).map_or((f64::NAN, f64::NAN), |steady| {
            (1e3 * steady.outputs.flow_corrected_kg_s, steady.outputs.pressure_ratio)
        })
    };
    let grid: Vec<(OperatingPoint, (f64, f64))> =
        campaign.points.iter().map(|point| (*point, place(*point))).collect();
    let panels = [
        ("(a) along speed lines", SPEED_LINES, along_lines),
        (&format!("(b) planned order, {}", plan.objective.replace('_', " ")), PLANNED, Some(plan)),
    ]
    .map(|(title, colour, plan)| match plan {
        None => speed_lines(&grid).title(format!("{title}: not within the limits")),
        Some(plan) => panel(&grid, plan, colour, &place).title(format!("{title}: {}", figures(plan))),
    });
    let steps = [Some(plan), along_lines].into_iter().flatten().map(|plan| plan.steps.len()).max();
    let every = match numbered_every(steps.unwrap_or(0)) {
        1 => "Numbers are those of the steps.".to_owned(),
        every => format!("The first, the last and every {every}th step have their number."),
    };
    let [a, b] = panels;
    Figure::new(format!("{}: order of the points", plan.campaign))
        .subtitle(format!(
            "{every} Total gradient: sum of the housing's temperature changes within the windows. Minutes of the steps, without soak \
             and warm-up."
        ))
        .panel(a)
        .panel(b)
        .panel_size_px(720.0, 620.0)
        .to_svg()
}

fn numbered_every(steps: usize) -> usize {
    match () {
        () if steps <= ALL_NUMBERED => 1,
        () if steps <= FIFTH_NUMBERED => 5,
        () => 10,
    }
}

fn figures(plan: &Plan) -> String {
    let minutes = plan.steps.iter().map(|step| step.dwell_s).sum::<f64>() / 60.0;
    format!("total gradient {:.0} K in {minutes:.0} min", plan.figures.sum_gradient_k)
}

/// The map without a path.
fn speed_lines(grid: &[(OperatingPoint, (f64, f64))]) -> Panel {
    let ends =
        |worse: f64, pick: fn(f64, f64) -> f64| grid.iter().map(|(_, place)| place.0).fold(worse, pick);
    // Room for numbers at the left, and for the names of the speed lines at their right ends.
    let (narrowest, widest) = (ends(f64::INFINITY, f64::min), ends(0.0, f64::max));
    let flow = Axis::new("corrected flow, g/s").range(0.7 * narrowest.min(widest), 1.12 * widest);
    let mut panel = Panel::new(flow, Axis::new("pressure ratio P2/P1"));
    let mut speeds: Vec<f64> = grid.iter().map(|(point, _)| point.speed_rpm).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    for speed_rpm in speeds {
        let of_speed = grid.iter().filter(|(point, _)| point.speed_rpm == speed_rpm);
        let mut line: Vec<(f64, f64)> = of_speed.map(|(_, place)| *place).collect();
        line.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(end) = line.last() {
            let text = format!("{:.0} krpm", speed_rpm / 1e3);
            panel.add(Annotation { colour: MAP_TEXT, shift_px: (9.0, -3.0), ..Annotation::new(text, *end) });
        }
        panel.add(Line::new(line, MAP).width_px(1.0).label("speed lines"));
    }
    panel
}

fn panel(
    grid: &[(OperatingPoint, (f64, f64))],
    plan: &Plan,
    colour: Colour,
    place: &impl Fn(OperatingPoint) -> (f64, f64),
) -> Panel {
    let mut panel = speed_lines(grid);
    let places: Vec<(f64, f64)> = plan.steps.iter().map(|step| place(step.to)).collect();
    let count = places.len();
    // More jumps need lighter lines, so that the numbers stay legible.
    let tint = (0.6 - 0.002 * count as f64).max(0.25);
    panel.add(Line::new(places.clone(), colour.tint(tint)).width_px(0.8).arrows().label("jumps"));
    panel.add(Scatter::new(places.clone(), colour).size_px(4.0));
    let repeats: Vec<(f64, f64)> = plan
        .steps
        .iter()
        .zip(&places)
        .filter(|(step, _)| step.kind == StepKind::Repeat)
        .map(|(_, at)| *at)
        .collect();
    if !repeats.is_empty() {
        panel.add(Scatter::new(repeats, colour).hollow().size_px(11.0).label("repeats for drift"));
    }
    panel.add(Scatter::new(places[..count.min(1)].to_vec(), FIRST).size_px(9.0).label("first step"));
    panel.add(PointLabels { labels: numbers(plan, &places), colour, size_px: 10.5 });
    panel
}

/// The numbers of the steps at each point, combined if there are several.
fn numbers(plan: &Plan, places: &[(f64, f64)]) -> Vec<(String, (f64, f64))> {
    let count = plan.steps.len();
    let mut labels: Vec<(OperatingPoint, String, (f64, f64))> = Vec::new();
    for ((place, step), at) in plan.steps.iter().enumerate().zip(places) {
        let number = step_number(place);
        if number != 1 && number != count && !number.is_multiple_of(numbered_every(count)) {
            continue;
        }
        match labels.iter_mut().find(|(point, ..)| *point == step.to) {
            Some((_, text, _)) => *text += &format!(", {number}"),
            None => labels.push((step.to, number.to_string(), *at)),
        }
    }
    labels.into_iter().map(|(_, text, at)| (text, at)).collect()
}
