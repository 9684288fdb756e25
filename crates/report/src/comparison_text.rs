//! A plan beside conventional mapping and the same points along speed lines.

use crate::number::percent;
use mapper_planner::{Comparison, STABLE_DRIFT_K_MIN, WayOfMapping};
use std::fmt::Write;

fn ways(comparison: &Comparison) -> [(&'static str, &'static str, &WayOfMapping); 3] {
    [
        ("proposed", "this plan", &comparison.proposed),
        ("conventional", "conventional, with stabilisation", &comparison.conventional),
        ("along_speed_lines", "along speed lines, same method", &comparison.along_speed_lines),
    ]
}

/// For machines: minutes and predicted errors of each way.
pub fn comparison_json(comparison: &Comparison) -> serde_json::Value {
    let entry = |(key, _, way): (&str, &str, &WayOfMapping)| {
        let value = serde_json::json!({
            "minutes": way.minutes,
            "worst_error_eta": way.worst_error_eta,
            "mean_error_eta": way.mean_error_eta,
            "order": way.order,
        });
        (key.to_owned(), value)
    };
    serde_json::Value::Object(ways(comparison).map(entry).into_iter().collect())
}

/// For people.
pub fn comparison_text(comparison: &Comparison) -> String {
    let mut text =
        "\nPredicted error of the efficiency, %points (without warm-up and cool-down):\n".to_owned();
    for (_, name, way) in ways(comparison) {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "  {name:<34}{:>7.0} min   worst {:>6}   mean {:>6}",
            way.minutes,
            percent(way.worst_error_eta, 2),
            percent(way.mean_error_eta, 2)
        );
    }
    let _ = writeln!(
        text,
        "Conventional: T2 and housing must drift by less than {STABLE_DRIFT_K_MIN} K/min; its error is that of heat transfer and of declared offsets."
    );
    text
}
