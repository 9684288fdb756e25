//! A plan beside conventional mapping and the same points under other orders.

use crate::number::percent;
use mapper_planner::{Comparison, STABLE_DRIFT_K_MIN, WayOfMapping};
use serde_json::{Value, json};
use std::fmt::Write;

/// For machines: minutes and predicted errors of each way.
pub fn comparison_json(comparison: &Comparison) -> Value {
    let entry = |way: &WayOfMapping| {
        json!({
            "minutes": way.minutes,
            "sum_gradient_k": way.sum_gradient_k,
            "worst_error_eta": way.worst_error_eta,
            "rms_error_eta": way.rms_error_eta,
            "open_rms_error_eta": way.open_rms_error_eta,
            "order": way.order,
        })
    };
    let orders: Vec<Value> = comparison
        .orders
        .iter()
        .map(|(name, way)| {
            let mut value = entry(way);
            value["name"] = name.as_str().into();
            value
        })
        .collect();
    json!({
        "proposed": entry(&comparison.proposed),
        "conventional": entry(&comparison.conventional),
        "orders": orders,
        "front": comparison.front(),
        "beaten_by": comparison.beaten_by().map(|(name, _)| name),
    })
}

/// For people.
pub fn comparison_text(comparison: &Comparison) -> String {
    let mut text =
        "\nPredicted error of the efficiency, %points (minutes without soak, warm-up and cool-down):\n"
            .to_owned();
    let mut line = |name: &str, way: &WayOfMapping| {
        let gradient = way.sum_gradient_k.map_or_else(|| "-".to_owned(), |sum_k| format!("{sum_k:.0}"));
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "  {name:<36}{:>6.0} min   rms {:>5}   open {:>5}   worst {:>5}   gradients {gradient:>5} K",
            way.minutes,
            percent(way.rms_error_eta, 2),
            percent(way.open_rms_error_eta, 2),
            percent(way.worst_error_eta, 2),
        );
    };
    line("this plan", &comparison.proposed);
    for (name, way) in &comparison.orders {
        line(&format!("order: {name}"), way);
    }
    line("conventional, with stabilisation", &comparison.conventional);
    let _ = writeln!(
        text,
        "Orders: the best for the time it takes first. Open: where alpha_A, probe and direction factor have to be found. Conventional: T2 and housing must drift by less than {STABLE_DRIFT_K_MIN} K/min; its error is that of heat transfer and of the same offsets."
    );
    let front = comparison.front();
    if front.len() > 1 {
        let _ = writeln!(
            text,
            "No other order beats these in gradients, open error and minutes at once, the largest gradients first: {}.",
            front.join("; ")
        );
    }
    if let Some((name, way)) = comparison.beaten_by() {
        let proposed = &comparison.proposed;
        let _ = writeln!(
            text,
            "`order: {name}` is forecast to do better than this plan: open {} points in {:.0} min, against {} in {:.0} min.",
            percent(way.open_rms_error_eta, 2),
            way.minutes,
            percent(proposed.open_rms_error_eta, 2),
            proposed.minutes
        );
    }
    text
}
