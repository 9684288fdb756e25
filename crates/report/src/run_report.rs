//! The test report of a run, as Markdown.

use crate::disagreement::disagreement_text;
use crate::display::Display;
use crate::doubts::doubts;
use crate::duration::duration;
use crate::markdown::{self, Align};
use crate::number::{number, percent};
use crate::points::{score_text, step_name, verdict_word};
use crate::repeated_jumps::repeated_jumps_text;
use crate::shared_errors::shared_errors_text;
use crate::surge_text::surge_text;
use mapper_assemble::RepeatedJump;
use mapper_campaign::Campaign;
use mapper_core::{Event, Plan};
use mapper_identify::TwoParameter;
use mapper_observe::FusedChannel;
use mapper_record::score::{ScoreSummary, ScoredMark, ScoredPoint};
use std::fmt::Write;

/// Everything a test report needs.
pub struct RunReport<'a> {
    /// Machine, rig, conditions, calibration, display units.
    pub campaign: &'a Campaign,
    /// What was run.
    pub plan: &'a Plan,
    /// How the run ended, in a sentence.
    pub outcome: &'a str,
    /// What happened on the way.
    pub events: &'a [Event],
    /// Identified points, repeats included.
    pub points: &'a [ScoredPoint],
    /// Jumps that were made more than once.
    pub repeats: &'a [RepeatedJump],
    /// What the two-parameter method makes of the same steps, where another method was used.
    pub two_parameter: &'a [TwoParameter],
    /// What became of channels with several sensors.
    pub sensors: &'a [FusedChannel],
    /// How far the points are from the simulator's truth; `None` on a real rig.
    pub score: Option<&'a ScoreSummary>,
    /// What came of the search for surge; `None` where there was none.
    pub surge: Option<SurgeReport<'a>>,
    /// Whether a picture of the map stands beside the report as `map.svg`.
    pub has_picture: bool,
}

/// What came of the search for surge.
#[derive(Clone, Copy)]
pub struct SurgeReport<'a> {
    /// Marks in order of speed.
    pub marks: &'a [ScoredMark],
    /// Lines on which none was found.
    pub remarks: &'a [String],
    /// How often the compressor went into surge.
    pub surges: usize,
}

/// The report as Markdown.
pub fn run_report(report: &RunReport<'_>) -> String {
    let RunReport {
        campaign,
        plan,
        outcome,
        events,
        points,
        repeats,
        two_parameter,
        sensors,
        score,
        surge,
        has_picture,
    } = *report;
    // Writing to a String cannot fail, here and below.
    let mut text = format!("# Compressor map of {}\n\n", campaign.machine.name);
    if let Some(disagreement) = disagreement_text(points, two_parameter, &campaign.display) {
        let _ = writeln!(text, "**{}**\n", disagreement.trim_end());
    }
    let _ = writeln!(text, "{outcome}\n");
    if has_picture {
        text.push_str("![map](map.svg)\n\n");
    }
    let rows: Vec<[String; 2]> =
        head_rows(campaign, plan).into_iter().map(|(what, value)| [what.to_owned(), value]).collect();
    text.push_str(&markdown::table(&["", ""], Align::Left, &rows));
    text.push('\n');
    if !campaign.report.calibration.is_empty() {
        let calibrated = campaign.report.calibration.iter();
        let rows: Vec<[String; 2]> = calibrated
            .map(|(channel, day)| [format!("{channel} ({})", channel.info().description), day.to_string()])
            .collect();
        text.push_str(&markdown::table(&["sensor", "last calibration"], Align::Left, &rows));
        text.push('\n');
    }
    if !sensors.is_empty() {
        let lines: String = sensors.iter().map(|fused| format!("- {fused}\n")).collect();
        let _ = writeln!(
            text,
            "## Several sensors\n\nFused by their declared uncertainty (one standard deviation).\n\n{lines}"
        );
    }
    if let Some(score) = score {
        let _ = writeln!(text, "{}", score_text(score));
    }
    points_section(&mut text, campaign, points);
    if let Some(SurgeReport { marks, remarks, surges }) = surge {
        let _ = write!(text, "\n## Surge\n\n{}", surge_text(marks, remarks, surges, &campaign.display));
    }
    if !repeats.is_empty() {
        let sentences = repeated_jumps_text(repeats, &Display::new(&campaign.display));
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
        ("duration", whole_duration(campaign, plan)),
        ("order", plan.objective.clone()),
        ("seed", plan.seed.to_string()),
        ("campaign SHA-256", plan.made_from.campaign_sha256.clone()),
        ("model SHA-256", plan.made_from.model_sha256.clone()),
    ]
}

/// Rest and steps, as `mapper check` and `mapper plan` count them.
fn whole_duration(campaign: &Campaign, plan: &Plan) -> String {
    match campaign.zero {
        Some(soak) => format!(
            "{}, {} of it at rest",
            duration(soak.duration_s + plan.duration_s()),
            duration(soak.duration_s)
        ),
        None => duration(plan.duration_s()),
    }
}

fn points_section(text: &mut String, campaign: &Campaign, points: &[ScoredPoint]) {
    let display = Display::new(&campaign.display);
    text.push_str(
        "## Points\n\nIntervals are 95 %: noise, declared sensor offsets, and what moving flow is estimated to cost the method.\n\n",
    );
    if let Some(shared) = shared_errors_text(points.iter().map(|scored| &scored.point), &campaign.display) {
        let _ = writeln!(text, "{shared}\n");
    }
    let heads = [
        "step",
        &display.speed_head("speed"),
        "opening",
        &display.flow_head("corrected flow"),
        "PR",
        "eta %",
        "eta interval %",
        "h W/(m2 K)",
        "h interval",
        "verdict",
    ];
    let rows: Vec<[String; 10]> = points
        .iter()
        .map(|ScoredPoint { point, .. }| {
            [
                step_name(point),
                display.speed(point.speed_rpm),
                point.valve_opening_ratio.to_string(),
                display.flow(point.flow_corrected_kg_s),
                format!("{:.4}", point.pressure_ratio),
                percent(point.eta, 2),
                format!("{} .. {}", percent(point.eta_low, 2), percent(point.eta_high, 2)),
                number(point.h_w_m2k, 0),
                format!("{} .. {}", number(point.h_low_w_m2k, 0), number(point.h_high_w_m2k, 0)),
                verdict_word(point.verdict).to_owned(),
            ]
        })
        .collect();
    text.push_str(&markdown::table(&heads, Align::Left, &rows));
    text.push_str("\n## Doubts and remarks\n\n");
    let doubts = doubts(points.iter().map(|scored| &scored.point));
    for doubt in &doubts {
        let _ = writeln!(text, "- {} ({}): {}", doubt.steps(), doubt.code, doubt.message);
    }
    if doubts.is_empty() {
        text.push_str("None.\n");
    }
}
