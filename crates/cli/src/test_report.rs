//! The test report of a run, as Markdown.

use crate::repeated_jumps::{self, RepeatedJump};
use crate::results::{score_text, step_name, verdict_word};
use crate::table::{self, Display, number};
use mapper_campaign::Campaign;
use mapper_core::{Event, Plan};
use mapper_score::{ScoreSummary, ScoredPoint};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

/// Everything a test report needs: machine, rig, conditions, calibration, map, points with their doubts, events.
#[allow(clippy::too_many_arguments, reason = "one place, and each is another part of the page")]
pub fn markdown(
    campaign: &Campaign,
    plan: &Plan,
    outcome: &str,
    events: &[Event],
    points: &[ScoredPoint],
    repeats: &[RepeatedJump],
    score: Option<&ScoreSummary>,
    map: &BTreeMap<String, PathBuf>,
) -> String {
    // Writing to a String cannot fail, here and below.
    let mut text = format!("# Compressor map of {}\n\n", campaign.machine.name);
    let _ = writeln!(text, "{outcome}\n");
    if map.contains_key("svg") {
        text.push_str("![map](map.svg)\n\n");
    }
    text.push_str("| | |\n|---|---|\n");
    for (what, value) in head_rows(campaign, plan) {
        let _ = writeln!(text, "| {what} | {} |", value.replace('|', "\\|"));
    }
    text.push('\n');
    if !campaign.report.calibration.is_empty() {
        text.push_str("| sensor | last calibration |\n|---|---|\n");
        for (channel, day) in &campaign.report.calibration {
            let _ = writeln!(text, "| {channel} ({}) | {day} |", channel.info().description);
        }
        text.push('\n');
    }
    if let Some(score) = score {
        let _ = writeln!(text, "{}", score_text(score));
    }
    points_section(&mut text, campaign, points);
    if !repeats.is_empty() {
        let sentences = repeated_jumps::sentences(repeats, &Display::new(&campaign.display));
        let _ = write!(
            text,
            "\n## Drift\n\nRepeats are kept out of the map. Fixed offsets cancel in what changes between them.\n\n{}",
            sentences.lines().map(|line| format!("- {line}\n")).collect::<String>()
        );
    }
    text.push_str("\n## Events\n\n");
    if events.is_empty() {
        text.push_str("None.\n");
    }
    for event in events {
        let _ = writeln!(text, "- {:.1} s: {}", event.t_s, event.message);
    }
    text
}

fn head_rows(campaign: &Campaign, plan: &Plan) -> Vec<(&'static str, String)> {
    let (display, report, boundary) = (Display::new(&campaign.display), &campaign.report, &campaign.boundary);
    let temperature = |k: f64| format!("{} {}", display.temperature(k), campaign.display.temperature);
    let pressure = |pa: f64| format!("{} {}", display.pressure(pa), campaign.display.pressure);
    let follows = || "held at the compressor's outlet temperature".to_owned();
    let missing = || "not stated".to_owned();
    let reference = &campaign.reference;
    vec![
        ("campaign", campaign.name.clone()),
        ("serial number", campaign.machine.serial_number.clone().unwrap_or_else(missing)),
        ("operator", report.operator.clone().unwrap_or_else(missing)),
        ("test cell", report.test_cell.clone().unwrap_or_else(missing)),
        ("rig", campaign.backend.name.clone()),
        ("barometer", report.barometer_pa.map_or_else(missing, pressure)),
        (
            "relative humidity",
            report.humidity_ratio.map_or_else(missing, |ratio| format!("{:.0} %", 100.0 * ratio)),
        ),
        ("inlet (total)", format!("{}, {}", temperature(boundary.t1_k), pressure(boundary.p1_pa))),
        (
            "turbine inlet temperature (total)",
            if campaign.follow_outlet.turbine_inlet { follows() } else { temperature(boundary.t3_k) },
        ),
        ("turbine outlet pressure", pressure(boundary.p4_pa)),
        (
            "oil temperature",
            if campaign.follow_outlet.oil { follows() } else { temperature(boundary.oil_temperature_k) },
        ),
        ("reference state of corrected quantities", reference.to_string()),
        (
            "identification",
            format!(
                "{}, alpha_A = {}",
                campaign.identification.method, campaign.identification.alpha_area_ratio
            ),
        ),
        ("duration", table::duration(plan.duration_s())),
        ("order", plan.objective.clone()),
        ("seed", plan.seed.to_string()),
        ("campaign SHA-256", plan.made_from.campaign_sha256.clone()),
        ("model SHA-256", plan.made_from.model_sha256.clone()),
    ]
}

fn points_section(text: &mut String, campaign: &Campaign, points: &[ScoredPoint]) {
    let (display, units) = (Display::new(&campaign.display), &campaign.display);
    let _ = writeln!(
        text,
        "## Points\n\nIntervals are 95 %: noise, declared sensor offsets, and what moving flow is estimated to cost the method.\n\n\
         | step | speed {} | opening | corrected flow {} | PR | eta % | eta interval % | h W/(m2 K) | h interval | verdict |\n\
         |---|---|---|---|---|---|---|---|---|---|",
        units.speed, units.flow
    );
    for ScoredPoint { point, .. } in points {
        let percent = |value: Option<f64>| number(value.map(|value| 100.0 * value), 2);
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {:.4} | {} | {} .. {} | {} | {} .. {} | {} |",
            step_name(point),
            display.speed(point.speed_rpm),
            point.valve_opening_ratio,
            display.flow(point.flow_corrected_kg_s),
            point.pressure_ratio,
            percent(point.eta),
            percent(point.eta_low),
            percent(point.eta_high),
            number(point.h_w_m2k, 0),
            number(point.h_low_w_m2k, 0),
            number(point.h_high_w_m2k, 0),
            verdict_word(point.verdict),
        );
    }
    text.push_str("\n## Doubts and remarks\n\n");
    let mut none = true;
    for ScoredPoint { point, .. } in points {
        for warning in &point.warnings {
            none = false;
            let _ = writeln!(text, "- step {} ({}): {}", point.step + 1, warning.code, warning.message);
        }
    }
    if none {
        text.push_str("None.\n");
    }
}
