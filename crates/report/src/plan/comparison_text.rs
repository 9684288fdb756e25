//! A plan compared with the same points in other orders and by conventional mapping.

use crate::formatting::number::{number, percent};
use crate::formatting::table;
use crate::formatting::wrapped::wrapped;
use mapper_core::Plan;
use mapper_planner::STABLE_DRIFT_K_MIN;
use serde_json::{Value, json};

/// Time of the steps, minutes.
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

/// For people, in 80 columns.
pub fn comparison_text(plan: &Plan, others: &[Plan]) -> String {
    let mut rows = table::with_heads(
        &["order", "steps min", "total K", "min K", "rms pts", "worst pts", "stated pts"].map(str::to_owned),
    );
    for plan in std::iter::once(plan).chain(others) {
        let figures = &plan.figures;
        rows.add_row([
            plan.objective.clone(),
            format!("{:.0}", minutes(plan)),
            format!("{:.0}", figures.sum_gradient_k),
            number(figures.min_gradient_k, 1),
            percent(figures.rms_error_eta, 2),
            percent(figures.worst_error_eta, 2),
            percent(figures.rms_error_reported_eta, 2),
        ]);
    }
    let legend = format!(
        "total, min: sum and minimum of the thermal gradients. rms, worst: expected error of the efficiency over the points, one sigma, if the machine is as \
         declared; stated: rms of the intervals, which contain other values of alpha_A, probe and heating/cooling ratio. \
         conventional: each point until T2 and housing drift by less than {STABLE_DRIFT_K_MIN} K/min; its error is heat transfer."
    );
    format!("\n{rows}\n\n{}", wrapped(&legend, 80, 0))
}
