//! A plan as text, in 80 columns.

use crate::formatting::display::Display;
use crate::formatting::duration::{duration, eta};
use crate::formatting::number::{number, percent};
use crate::formatting::table;
use crate::formatting::wrapped::wrapped;
use crate::plan::plan_remark_text::{no_bound_text, plan_remark_text};
use mapper_campaign::Campaign;
use mapper_core::{Plan, PlanBound, PlanStep, StepKind, VisitOrder, step_number};

/// Width of the text behind the names of the summary, characters: 80 with them.
const SUMMARY_WIDTH: usize = 62;

/// The plan as a table, a legend and a summary.
pub fn plan_text(campaign: &Campaign, plan: &Plan) -> String {
    let display = Display::new(&campaign.display);
    let mut steps = table::with_heads(&[
        "step".to_owned(),
        display.speed_head("N"),
        "valve".to_owned(),
        display.pressure_head("P3"),
        display.flow_head("m_c"),
        "PR".to_owned(),
        display.temperature_head("T2"),
        "dTc K".to_owned(),
        "+/- pts".to_owned(),
        "settles s".to_owned(),
        "ends".to_owned(),
    ]);
    // The machine soaks before the plan begins.
    let soak_s = campaign.zero.map_or(0.0, |zero| zero.duration_s);
    for step in &plan.steps {
        let predicted = &step.predicted;
        steps.add_row([
            format!("{}{}", step_number(step.index), mark(step.kind)),
            display.speed(step.to.speed_rpm),
            step.to.shown().1.to_string(),
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
    format!("{steps}\n\n{}\n{}", legend(plan), summary(campaign, plan, soak_s))
}

/// The mark of a step that is not a point of the grid.
pub(crate) fn mark(kind: StepKind) -> &'static str {
    match kind {
        StepKind::Point => "",
        StepKind::Repeat => "r",
        StepKind::Return => "a",
        StepKind::Approach => "s",
    }
}

/// The meaning of the marks of these steps; empty without any.
pub(crate) fn marks_legend(kinds: &[StepKind]) -> String {
    let marks = [
        (StepKind::Repeat, "r visits a point again, to show drift or to lead around a forbidden jump"),
        (StepKind::Return, "a visits the first point again"),
        (StepKind::Approach, "s approaches surge"),
    ];
    let marked: Vec<&str> =
        marks.into_iter().filter(|(kind, _)| kinds.contains(kind)).map(|(_, text)| text).collect();
    if marked.is_empty() { String::new() } else { format!("step: {}. ", marked.join(", ")) }
}

fn legend(plan: &Plan) -> String {
    let marked = marks_legend(&plan.steps.iter().map(|step| step.kind).collect::<Vec<_>>());
    let text = format!(
        "{marked}valve: opening of the back-pressure valve. P3: turbine inlet pressure. m_c, PR, T2: at the end of the step. dTc: change of the compressor \
         housing's temperature in the window, the thermal gradient. +/-: expected error of the efficiency, points, one sigma. settles: after the jump. ends: after \
         the start of the run."
    );
    wrapped(&text, 80, 0)
}

/// Totals of the plan, a line for each figure.
fn summary(campaign: &Campaign, plan: &Plan, soak_s: f64) -> String {
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
        let least = format!("{min_gradient_k:.1} K{}", least_bound(plan));
        lines.extend([("total gradient", total_gradient(plan)), ("min gradient", least)]);
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
    lines.extend(plan.bound_remark.iter().map(|reason| ("bound", no_bound_text(*reason).to_owned())));
    lines.extend(plan.remarks.iter().map(|remark| ("note", plan_remark_text(remark))));
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
    let line = |(name, text): &(&str, String)| {
        let indent = " ".repeat(80 - SUMMARY_WIDTH);
        let text = wrapped(text, SUMMARY_WIDTH, 0).replace('\n', &format!("\n{indent}"));
        format!("{name:<width$}{}\n", text.trim_end(), width = 80 - SUMMARY_WIDTH)
    };
    lines.iter().map(line).collect()
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

fn total_gradient(plan: &Plan) -> String {
    let total = format!("{:.0} K of housing temperature over all points", plan.figures.sum_gradient_k);
    let Some(bound) = &plan.bound else { return total };
    let bounded = format!("{total}; no order exceeds {:.0} K", bound.sum_gradient_k);
    let by_gap = |gap: f64| format!("{bounded}, so this one is within {gap:.1} % of the best possible");
    match (bound.gap_percent, bound.proof_tolerance_percent) {
        (Some(_), Some(tolerance)) if plan.objective == VisitOrder::ThermalGradient.name() => {
            format!("{total}; proven to be the best order within {tolerance:.1} %")
        }
        (Some(gap), _) if plan.objective == VisitOrder::ThermalGradient.name() => by_gap(gap),
        _ => bounded,
    }
}

fn least_bound(plan: &Plan) -> String {
    let bound_text = |bound: &PlanBound| match (bound.proof_tolerance_percent, bound.gap_percent) {
        (Some(tolerance), _) => format!("; proven to be the best order within {tolerance:.1} %"),
        (None, Some(gap)) => {
            format!("; no order exceeds {:.1} K, so this one is within {gap:.1} %", bound.min_gradient_k)
        }
        (None, None) => String::new(),
    };
    plan.bound
        .as_ref()
        .filter(|_| plan.objective == VisitOrder::MinGradient.name())
        .map_or_else(String::new, bound_text)
}
