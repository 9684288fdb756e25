//! One edge of the jump graph as text: its result and the reasons against it.

use crate::formatting::display::Display;
use crate::formatting::number::{number, percent};
use mapper_campaign::Campaign;
use mapper_planner::JumpForecast;
use serde_json::json;
use std::fmt::Write;

/// The same for a program, SI.
pub fn jump_json(jump: &JumpForecast) -> serde_json::Value {
    json!({
        "from": jump.from,
        "to": jump.to,
        "predicted": jump.predicted,
        "p3_change_pa": jump.p3_change_pa,
        "longest_surge_s": jump.longest_surge_s,
        "highest_speed_rpm": jump.highest_speed_rpm,
        "highest_t2_k": jump.highest_t2_k,
        "allowed": jump.rejections.is_empty(),
        "rejections": jump.rejections.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

/// The result of the jump from the steady state of its first point, and each reason against it.
pub fn jump_text(campaign: &Campaign, jump: &JumpForecast) -> String {
    let display = Display::new(&campaign.display);
    let predicted = &jump.predicted;
    // A method that identifies all steps together has no error of a single jump.
    let points = |error: Option<f64>| {
        error.map_or_else(
            || "not of one jump alone".to_owned(),
            |error| format!("{} points", percent(Some(error), 2)),
        )
    };
    let mut text = format!(
        "{} -> {} (from the steady state of the first)\n",
        display.place(jump.from),
        display.place(jump.to)
    );
    let change = jump.p3_change_pa / 1e3;
    let rows = [
        ("change of P3", format!("{change:+.1} kPa")),
        ("dT2 in the window", format!("{} K", number(predicted.dt2_k, 2))),
        ("dTc in the window", format!("{} K", number(predicted.dtc_k, 2))),
        ("settles after", format!("{} s", number(predicted.settle_s, 1))),
        ("standard error of eta", points(predicted.sigma_eta)),
        ("bias of the method", points(predicted.bias_eta)),
        ("beyond the surge line", format!("{:.2} s at a stretch", jump.longest_surge_s)),
        ("highest speed", format!("{} {}", display.speed(jump.highest_speed_rpm), campaign.display.speed)),
        (
            "highest T2",
            format!("{} {}", display.temperature(jump.highest_t2_k), campaign.display.temperature),
        ),
    ];
    for (what, value) in rows {
        let _ = writeln!(text, "  {what:<24}{value}");
    }
    if jump.rejections.is_empty() {
        text.push_str("Allowed.\n");
    }
    for rejection in &jump.rejections {
        let _ = writeln!(text, "Not allowed: {rejection}.");
    }
    text
}
