//! A plan before its run, compared with other orders, and after it; and its picture as in figure 13 of the paper.

use crate::document::{Cell, Document, Table};
use crate::formatting::{Display, Message, duration, eta, number, percent};
use mapper_campaign::Campaign;
use mapper_campaign::units::Kind;
use mapper_chart::{Annotation, Axis, Colour, Figure, Line, Panel, PointLabels, Scatter};
use mapper_core::{
    AvoidedCrossing, OperatingPoint, Plan, PlanStep, Recording, StepKind, Transition, WindowRule,
    standard_error_of, step_number, valve_area_text,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::hold_speed;
use mapper_planner::{JumpForecast, STABLE_DRIFT_K_MIN};
use mapper_recording::score::ScoredPoint;
use serde_json::{Value, json};

/// The plan as a table, a legend and a summary.
pub fn plan_document(campaign: &Campaign, plan: &Plan) -> Document {
    let display = Display::new(&campaign.display);
    let mut steps = Table::new([
        "step".to_owned(),
        display.head("N", Kind::Speed),
        "valve".to_owned(),
        display.head("P3", Kind::Pressure),
        display.head("m_c", Kind::MassFlow),
        "PR".to_owned(),
        display.head("T2", Kind::Temperature),
        "dTc K".to_owned(),
        "+/- pts".to_owned(),
        "settles s".to_owned(),
        "ends".to_owned(),
    ]);
    // The machine soaks before the plan begins.
    let soak_s = campaign.zero.map_or(0.0, |zero| zero.duration_s);
    for step in &plan.steps {
        let predicted = &step.predicted;
        steps.row([
            format!("{}{}", step_number(step.index), mark(step.kind)),
            display.speed(step.to.speed_rpm),
            valve_area_text(step.to.valve_opening_ratio),
            display.pressure(step.p3_pa),
            display.flow(predicted.flow_kg_s),
            format!("{:.3}", predicted.pressure_ratio),
            display.temperature(predicted.t2_k),
            number(predicted.dtc_k, 1),
            percent(predicted.sigma_eta.map(|sigma| sigma.hypot(predicted.bias_eta.unwrap_or(0.0))), 2),
            number(predicted.settle_s, 1),
            eta(soak_s + step.start_s + step.dwell_s),
        ]);
    }
    let mut document = Document::default();
    document.table(steps);
    document.text(legend(plan));
    document.facts("", summary(campaign, plan, soak_s));
    document
}

fn mark(kind: StepKind) -> &'static str {
    match kind {
        StepKind::Point => "",
        StepKind::Repeat => "r",
        StepKind::Return => "a",
        StepKind::Approach => "s",
    }
}

fn marks_legend(kinds: &[StepKind]) -> String {
    let marks = [
        (StepKind::Repeat, "r visits a point again, to show drift or to lead around a forbidden jump"),
        (StepKind::Return, "a returns to the first point"),
        (StepKind::Approach, "s approaches surge"),
    ];
    let marked: Vec<&str> =
        marks.into_iter().filter(|(kind, _)| kinds.contains(kind)).map(|(_, text)| text).collect();
    if marked.is_empty() { String::new() } else { format!("step: {}. ", marked.join(", ")) }
}

fn legend(plan: &Plan) -> String {
    let marked = marks_legend(&plan.steps.iter().map(|step| step.kind).collect::<Vec<_>>());
    format!(
        "{marked}valve: area of the back-pressure valve, per cent of its nominal area. P3: turbine inlet pressure. m_c, PR, T2: at the end of the step. dTc: change of the compressor \
         housing's temperature in the window, the thermal gradient. +/-: expected error of the efficiency, points, one sigma. settles: after the jump. ends: after \
         the start of the run."
    )
}

fn summary(campaign: &Campaign, plan: &Plan, soak_s: f64) -> Vec<(&'static str, String)> {
    let figures = &plan.figures;
    let steps_s: f64 = plan.steps.iter().map(|step| step.dwell_s).sum();
    let parts = [
        ("soak", soak_s),
        ("warm-up", plan.warm_up_s),
        ("steps", steps_s),
        ("search for surge", plan.surge_search_s),
        ("cool-down", plan.cool_down_s),
    ];
    let parts: Vec<String> = parts
        .into_iter()
        .filter(|(_, time_s)| *time_s > 0.0)
        .map(|(name, time_s)| format!("{name} {}", duration(time_s)))
        .collect();
    let mut lines = vec![
        ("plan", format!("{}, {} by {}", plan.campaign, steps(&plan.steps), plan.objective)),
        ("rig time", format!("{} ({})", duration(soak_s + plan.duration_s()), parts.join(", "))),
    ];
    if let Some(min_gradient_k) = figures.min_gradient_k {
        let total = format!("{:.0} K of housing temperature over all points", figures.sum_gradient_k);
        lines.extend([("total gradient", total), ("min gradient", format!("{min_gradient_k:.1} K"))]);
    }
    let declared = figures.rms_error_eta.map(|error| {
        format!(
            "{} points of efficiency rms over the points, {} at the worst point (one sigma), if the machine is as declared",
            percent(Some(error), 2),
            percent(figures.worst_error_eta, 2)
        )
    });
    let reported = figures.rms_error_reported_eta.map(|error| {
        format!(
            "the intervals will state {} rms, because they also cover the uncertainty of alpha_A, probe and heating/cooling ratio",
            percent(Some(error), 2)
        )
    });
    let errors: Vec<String> = declared.into_iter().chain(reported).collect();
    if !errors.is_empty() {
        lines.push(("expected error", errors.join("; ")));
    }
    lines.extend(transition_lines(
        plan,
        &Display::new(&campaign.display),
        &campaign.display.speed.to_string(),
    ));
    lines.extend(plan.remarks.iter().map(|remark| ("note", remark.message())));
    if !campaign.machine.assumed.is_empty() {
        let sizes = match campaign.machine.assumed.len() {
            1 => "1 size".to_owned(),
            count => format!("{count} sizes"),
        };
        lines.push((
            "assumed",
            format!("{sizes} of the machine, scaled from its wheel; `mapper check` gives the values"),
        ));
    }
    let made_from = &plan.made_from;
    let short = |hash: &str| hash.chars().take(12).collect::<String>();
    let hashes =
        format!("campaign {}, model {}", short(&made_from.campaign_sha256), short(&made_from.model_sha256));
    lines.push(("made from", hashes));
    lines
}

/// The jumps that come closest to a limit, and the time that the stand's actuators cost.
fn transition_lines(plan: &Plan, display: &Display, speed_unit: &str) -> Vec<(&'static str, String)> {
    let jumps: Vec<(&PlanStep, Transition)> =
        plan.steps.iter().filter_map(|step| Some((step, step.transition?))).collect();
    let worst = |value: &dyn Fn(&(&PlanStep, Transition)) -> f64| {
        jumps.iter().max_by(|a, b| value(a).total_cmp(&value(b)))
    };
    let fastest = worst(&|(_, transition)| transition.highest_speed_rpm);
    let closest = worst(&|(_, transition)| -transition.lowest_surge_margin_ratio);
    let latest = worst(&|(_, transition)| transition.arrival_s);
    let (Some(fastest), Some(closest), Some(latest)) = (fastest, closest, latest) else { return Vec::new() };
    let number = |jump: &(&PlanStep, Transition)| step_number(jump.0.index);
    let limits = format!(
        "highest speed {} {speed_unit} (step {}), lowest surge margin {} % (step {}), P3 and valve arrive within {:.1} s (step {})",
        display.speed(fastest.1.highest_speed_rpm),
        number(fastest),
        percent(Some(closest.1.lowest_surge_margin_ratio), 1),
        number(closest),
        latest.1.arrival_s,
        number(latest)
    );
    let late_s =
        jumps.iter().map(|(_, transition)| (transition.arrival_s - WindowRule::EARLIEST_S).max(0.0).ceil());
    let slow_s: f64 = late_s.sum();
    let mut lines = vec![("jumps", limits)];
    if slow_s > 0.0 {
        let text = format!(
            "P3 and valve arrive later than {:.0} s after some jumps; these steps are longer, {} in total",
            WindowRule::EARLIEST_S,
            duration(slow_s)
        );
        lines.push(("slow stand", text));
    }
    lines
}

fn steps(steps: &[PlanStep]) -> String {
    let dwells = || steps.iter().map(|step| step.dwell_s);
    let (shortest_s, longest_s) = (dwells().fold(f64::INFINITY, f64::min), dwells().fold(0.0, f64::max));
    match steps.len() {
        0 => "no steps".to_owned(),
        1 => format!("1 step of {shortest_s:.0} s"),
        count if shortest_s == longest_s => format!("{count} steps of {shortest_s:.0} s"),
        count => format!("{count} steps of {shortest_s:.0} to {longest_s:.0} s"),
    }
}

fn minutes(plan: &Plan) -> f64 {
    plan.steps.iter().map(|step| step.dwell_s).sum::<f64>() / 60.0
}

/// For machines: gradients, minutes and predicted errors by order, the plan first.
pub fn comparison_json(plan: &Plan, others: &[Plan]) -> Value {
    let entry = |plan: &Plan| {
        json!({
            "order": plan.objective,
            "minutes": minutes(plan),
            "sum_gradient_k": plan.figures.sum_gradient_k,
            "min_gradient_k": plan.figures.min_gradient_k,
            "rms_error_eta": plan.figures.rms_error_eta,
            "rms_error_reported_eta": plan.figures.rms_error_reported_eta,
            "worst_error_eta": plan.figures.worst_error_eta,
        })
    };
    std::iter::once(plan).chain(others).map(entry).collect()
}

/// A row for each order, the plan first.
pub fn plan_comparison(plan: &Plan, others: &[Plan]) -> Document {
    let heads = ["order", "steps min", "total K", "min K", "rms pts", "worst pts", "stated pts"];
    let row = |plan: &Plan| {
        let figures = &plan.figures;
        [
            plan.objective.clone(),
            format!("{:.0}", minutes(plan)),
            format!("{:.0}", figures.sum_gradient_k),
            number(figures.min_gradient_k, 1),
            percent(figures.rms_error_eta, 2),
            percent(figures.worst_error_eta, 2),
            percent(figures.rms_error_reported_eta, 2),
        ]
    };
    let mut document = Document::default();
    document.table(Table::new(heads).rows(std::iter::once(plan).chain(others).map(row)));
    document.text(format!(
        "total, min: sum and minimum of the thermal gradients. rms, worst: expected error of the efficiency over the points, one sigma, if the machine is as \
         declared; stated: rms of the intervals, which contain other values of alpha_A, probe and heating/cooling ratio. \
         conventional: each point until T2 and housing drift by less than {STABLE_DRIFT_K_MIN} K/min; its error is heat transfer."
    ));
    document
}

/// The same for a program, SI.
pub fn jump_json(jump: &JumpForecast) -> serde_json::Value {
    json!({
        "from": jump.from,
        "to": jump.to,
        "predicted": jump.predicted,
        "p3_change_pa": jump.p3_change_pa,
        "arrival_s": jump.arrival_s,
        "lowest_surge_margin_ratio": jump.lowest_surge_margin_ratio,
        "highest_speed_rpm": jump.highest_speed_rpm,
        "highest_t2_k": jump.highest_t2_k,
        "avoided": jump.avoided,
        "allowed": jump.rejections.is_empty(),
        "rejections": jump.rejections.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

/// The result of the jump from the steady state of its first point, and each reason against it.
pub fn jump_forecast(campaign: &Campaign, jump: &JumpForecast) -> Document {
    let display = Display::new(&campaign.display);
    let predicted = &jump.predicted;
    // A method that identifies all steps together has no error of a single jump.
    let points = |error: Option<f64>| {
        error.map_or_else(
            || "known only for all steps together".to_owned(),
            |error| format!("{} points", percent(Some(error), 2)),
        )
    };
    let mut document = Document::default();
    document.text(format!(
        "{} -> {} (from the steady state of the first)",
        display.place(jump.from),
        display.place(jump.to)
    ));
    let change = jump.p3_change_pa / 1e3;
    let rows = [
        ("change of P3", format!("{change:+.1} kPa")),
        ("dT2 in the window", format!("{} K", number(predicted.dt2_k, 2))),
        ("dTc in the window", format!("{} K", number(predicted.dtc_k, 2))),
        ("settles after", format!("{} s", number(predicted.settle_s, 1))),
        ("standard error of eta", points(predicted.sigma_eta)),
        ("bias of the method", points(predicted.bias_eta)),
        ("P3 and valve arrive after", format!("{:.1} s", jump.arrival_s)),
        ("lowest surge margin", format!("{} %", percent(Some(jump.lowest_surge_margin_ratio), 1))),
        ("highest speed", format!("{} {}", display.speed(jump.highest_speed_rpm), campaign.display.speed)),
        (
            "highest T2",
            format!("{} {}", display.temperature(jump.highest_t2_k), campaign.display.temperature),
        ),
    ];
    let avoided = jump.avoided.map(|crossing| ("within speeds to avoid", avoided_time(&crossing)));
    document.facts("", rows.into_iter().chain(avoided));
    if jump.rejections.is_empty() {
        document.text("Allowed.");
    }
    jump.rejections.iter().for_each(|rejection| document.text(format!("Not allowed: {rejection}.")));
    document
}

pub(crate) fn avoided_time(AvoidedCrossing { range, inside_s }: &AvoidedCrossing) -> String {
    let (from_krpm, to_krpm) = (range.from_rpm / 1e3, range.to_rpm / 1e3);
    format!("{inside_s:.1} s in {from_krpm} to {to_krpm} krpm, {:.1} s allowed", range.longest_s)
}

pub(crate) fn executed_plan_table(
    plan: &Plan,
    recording: &Recording,
    points: &[ScoredPoint],
    display: &Display,
) -> Table {
    let mut table = Table::new([
        "step".to_owned(),
        display.head("from @ valve area,", Kind::Speed),
        display.head("to @ valve area,", Kind::Speed),
        display.head("N reached", Kind::Speed),
        "lasted s".to_owned(),
        "planned s".to_owned(),
        "dTc K".to_owned(),
        "sigma of eta expected, points".to_owned(),
        "sigma of eta achieved, points".to_owned(),
    ])
    .caption("Steps")
    .with_texts([1, 2]);
    for step in &plan.steps {
        let point = points.iter().map(|scored| &scored.point).find(|point| point.step == step.index);
        table.row_of_step(point.map(|point| point.step), cells(step, recording, point, display));
    }
    table
}

fn cells(
    step: &PlanStep,
    recording: &Recording,
    point: Option<&mapper_core::IdentifiedPoint>,
    display: &Display,
) -> Vec<Cell> {
    let marker = recording.steps.iter().find(|marker| marker.index == step.index);
    let tenths = |value: Option<f64>| Cell::optional(value, |value| number(Some(value), 1));
    let in_points = |sigma: Option<f64>| Cell::optional(sigma, |sigma| percent(Some(sigma), 2));
    let achieved = point.and_then(|point| Some(standard_error_of(point.eta_low?, point.eta_high?)));
    vec![
        Cell::number(step_number(step.index).to_string(), step.index as f64),
        step.from.map_or_else(|| "-".to_owned(), |from| display.place(from)).into(),
        display.place(step.to).into(),
        Cell::optional(point.map(|point| point.speed_rpm), |rpm| display.speed(rpm)),
        tenths(marker.map(|marker| marker.end_s - marker.start_s)),
        tenths(Some(step.dwell_s)),
        tenths(point.and_then(|point| point.dtc_k)),
        in_points(step.predicted.reported_sigma_eta.or(step.predicted.sigma_eta)),
        in_points(achieved),
    ]
}

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
