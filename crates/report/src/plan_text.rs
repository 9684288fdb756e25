//! A plan for people.

use crate::display::Display;
use crate::duration::{duration, eta};
use crate::number::{number, percent};
use crate::table;
use mapper_campaign::Campaign;
use mapper_core::{Plan, PlanBound, StepKind, step_number};
use std::fmt::Write;

fn bound_text(bound: &PlanBound) -> String {
    let mut text = format!(
        "No order has a sum above {:.1} K, or a minimum above {:.1} K",
        bound.sum_gradient_k, bound.worst_gradient_k
    );
    // Writing to a String cannot fail.
    if let Some(gap) = bound.gap_percent {
        let _ = write!(text, ": this one is within {gap:.1} % of what is possible");
    }
    if let Some(tolerance) = bound.proof_tolerance_percent.filter(|_| bound.proven) {
        let _ = write!(text, ", and proven to be the best within {tolerance:.1} %");
    }
    let _ = writeln!(
        text,
        ". The search's housing model is off by at most {:.2} K along this plan.",
        bound.model_error_k
    );
    text
}

/// The plan as a table with its figures below.
pub fn plan_text(campaign: &Campaign, plan: &Plan) -> String {
    let display = Display::new(&campaign.display);
    let mut steps = table::with_heads(&[
        "step".to_owned(),
        format!("from {} @ opening", campaign.display.speed),
        format!("to {} @ opening", campaign.display.speed),
        display.pressure_head("P3"),
        display.flow_head("flow"),
        "PR".to_owned(),
        display.temperature_head("T2"),
        "dT2 K".to_owned(),
        "dTc K".to_owned(),
        "sigma_eta %".to_owned(),
        "bias %".to_owned(),
        "sigma_h %".to_owned(),
        "settles s".to_owned(),
        "min".to_owned(),
        "ETA".to_owned(),
    ]);
    // The machine rests before the plan begins.
    let soak_s = campaign.zero.map_or(0.0, |zero| zero.duration_s);
    for step in &plan.steps {
        let predicted = &step.predicted;
        steps.add_row([
            match step.kind {
                StepKind::Point => step_number(step.index).to_string(),
                StepKind::Repeat => format!("{} repeat", step_number(step.index)),
                StepKind::Return => format!("{} again", step_number(step.index)),
                StepKind::Approach => format!("{} surge", step_number(step.index)),
            },
            step.from.map_or_else(|| "-".to_owned(), |from| display.place(from)),
            display.place(step.to),
            display.pressure(step.p3_pa),
            display.flow(predicted.flow_kg_s),
            format!("{:.3}", predicted.pressure_ratio),
            display.temperature(predicted.t2_k),
            number(predicted.dt2_k, 1),
            number(predicted.dtc_k, 1),
            percent(predicted.sigma_eta, 2),
            percent(predicted.bias_eta, 2),
            percent(predicted.sigma_h_rel, 1),
            number(predicted.settle_s, 1),
            format!("{:.1}", predicted.minutes),
            eta(soak_s + step.start_s + step.dwell_s),
        ]);
    }
    let figures = &plan.figures;
    let mut text = format!("{steps}\n\n");
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{}: {} steps, order {}, {} in total ({}warm-up {}, cool-down {}).",
        plan.campaign,
        plan.steps.len(),
        plan.objective,
        duration(soak_s + plan.duration_s()),
        campaign.zero.map_or_else(String::new, |zero| format!("soak {}, ", duration(zero.duration_s))),
        duration(plan.warm_up_s),
        duration(plan.cool_down_s),
    );
    let _ = writeln!(
        text,
        "Housing gradient within the windows: {:.1} K in total, {} K at minimum.",
        figures.sum_gradient_k,
        number(figures.worst_gradient_k, 1),
    );
    if figures.worst_sigma_eta.is_some() {
        let _ = writeln!(
            text,
            "Predicted error of the efficiency, %points: standard error {} at worst; with the method's own bias {} at worst, {} rms.",
            percent(figures.worst_sigma_eta, 2),
            percent(figures.worst_error_eta, 2),
            percent(figures.rms_error_eta, 2),
        );
        if figures.open_rms_error_eta != figures.rms_error_eta {
            let _ = writeln!(
                text,
                "Where alpha_A, the probe and the direction of the heat are not as declared and have to be found: {} rms.",
                percent(figures.open_rms_error_eta, 2),
            );
        }
    }
    if let Some(bound) = &plan.bound {
        text.push_str(&bound_text(bound));
    }
    if let Some(bound) = &plan.error_bound {
        let _ = writeln!(
            text,
            "By what all steps tell, before points learn from their neighbours on the map, the error of this plan is {} rms; no order of its points, \
             each for as long, comes below {}.",
            percent(Some(bound.error_eta), 2),
            percent(Some(bound.least_error_eta), 2),
        );
    }
    if let Some(remark) = &plan.bound_remark {
        let _ = writeln!(text, "Bound: {remark}.");
    }
    for remark in &plan.remarks {
        let _ = writeln!(text, "Note: {remark}.");
    }
    let made_from = &plan.made_from;
    let short = |hash: &str| hash.chars().take(12).collect::<String>();
    let _ = writeln!(
        text,
        "Made from campaign {} and model {}.",
        short(&made_from.campaign_sha256),
        short(&made_from.model_sha256),
    );
    text
}
