//! The points by speed line, as test reports list them.

use crate::run_page::RunPage;
use crate::table::{Cell, Row, data_table};
use mapper_core::{Channel, IdentifiedPoint, Recording, StepMarker, Verdict, half_width_95};
use mapper_numerics::statistics::mean;
use mapper_report::{Display, number, percent, shared_errors_text, step_name, verdict_word};
use maud::{Markup, html};

/// The last seconds of a step, over which readings are averaged for the table.
const END_S: f64 = 2.0;

pub(crate) fn points(page: &RunPage<'_>, display: &Display) -> Markup {
    let report = page.report;
    let all = || report.points.iter().map(|scored| &scored.point);
    let lines = page.map.map_or(&[][..], |map| map.lines.as_slice());
    let on_a_line =
        |step: usize| lines.iter().any(|line| line.points.iter().any(|point| point.identified.step == step));
    let others: Vec<&IdentifiedPoint> = all().filter(|point| !on_a_line(point.step)).collect();
    let shared = shared_errors_text(all(), display.units());
    html! {
        section #points aria-labelledby="points-head" {
            h2 #points-head { "Points by speed line" }
            p {
                "Intervals are 95 %. Readings of T2, P1, P2 and T3 are means over the last " (END_S) " s of the step, when the gas is settled and the \
                 housing is not. The flow's and the pressure ratio's intervals are those of their sensors."
            }
            @if let Some(shared) = shared { p { (shared) } }
            @for line in lines {
                @let mut of_line = line.points.iter().map(|point| &point.identified).collect::<Vec<_>>();
                @let () = of_line.sort_by(|a, b| a.flow_corrected_kg_s.total_cmp(&b.flow_corrected_kg_s));
                (table_of(page, display, &format!("{} {} corrected", display.speed(line.speed_corrected_rpm), display.units().speed), &of_line))
            }
            @if !others.is_empty() { (table_of(page, display, "Repeats, and points that are not on the map", &others)) }
        }
    }
}

fn table_of(page: &RunPage<'_>, display: &Display, caption: &str, points: &[&IdentifiedPoint]) -> Markup {
    let heads = [
        "step".to_owned(),
        display.speed_head("N"),
        display.speed_head("N corr."),
        "opening".to_owned(),
        display.flow_head("flow corr."),
        "+/-".to_owned(),
        "PR".to_owned(),
        "+/-".to_owned(),
        "eta %".to_owned(),
        "+/-".to_owned(),
        "h W/(m2 K)".to_owned(),
        "+/-".to_owned(),
        display.temperature_head("T1"),
        display.pressure_head("P1"),
        display.temperature_head("T2"),
        display.pressure_head("P2"),
        display.temperature_head("T3"),
        "verdict".to_owned(),
    ];
    let rows: Vec<Row> = points.iter().map(|point| row(page, display, point)).collect();
    data_table(caption, &heads, &rows)
}

fn row(page: &RunPage<'_>, display: &Display, point: &IdentifiedPoint) -> Row {
    let marker = page.recording.steps.iter().find(|marker| marker.index == point.step);
    let read = |channel| marker.and_then(|marker| at_end(page.recording, marker, channel));
    let temperature = |k: Option<f64>| match k {
        Some(k) => Cell::number(display.temperature(k), k),
        None => Cell::text("-"),
    };
    let pressure = |pa: Option<f64>| match pa {
        Some(pa) => Cell::number(display.pressure(pa), pa),
        None => Cell::text("-"),
    };
    let half = |low: Option<f64>, high: Option<f64>| low.zip(high).map(|(low, high)| 0.5 * (high - low));
    let optional = |text: String, value: Option<f64>| Cell::number(text, value.unwrap_or(f64::NAN));
    let flow_half_kg_s =
        half_width_95(point.common.flow_corrected_standard_error_ratio) * point.flow_corrected_kg_s;
    let pr_half = half_width_95(point.common.pressure_ratio_standard_error);
    let (eta_half, h_half) =
        (half(point.eta_low, point.eta_high), half(point.h_low_w_m2k, point.h_high_w_m2k));
    // A half width of 0 says that nobody declared the sensor, not that it is perfect.
    let known = |half: f64, text: String| if half > 0.0 { Cell::number(text, half) } else { Cell::text("-") };
    let word = verdict_word(point.verdict);
    let valve = point.valve_opening_ratio;
    Row {
        step: Some(point.step),
        cells: vec![
            Cell::number(step_name(point), point.step as f64),
            Cell::number(display.speed(point.speed_rpm), point.speed_rpm),
            Cell::number(display.speed(point.speed_corrected_rpm), point.speed_corrected_rpm),
            Cell::number(number(Some(valve), 2), valve),
            Cell::number(display.flow(point.flow_corrected_kg_s), point.flow_corrected_kg_s),
            known(flow_half_kg_s, display.flow(flow_half_kg_s)),
            Cell::number(format!("{:.4}", point.pressure_ratio), point.pressure_ratio),
            known(pr_half, format!("{pr_half:.4}")),
            optional(percent(point.eta, 2), point.eta),
            optional(percent(eta_half, 2), eta_half),
            optional(number(point.h_w_m2k, 0), point.h_w_m2k),
            optional(number(h_half, 0), h_half),
            temperature(Some(point.t1_k)),
            pressure(Some(point.p1_pa)),
            temperature(read(Channel::T2)),
            pressure(read(Channel::P2)),
            temperature(read(Channel::T3)),
            Cell::text(word).class(class_of(point.verdict)),
        ],
    }
}

fn class_of(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Good => "good",
        Verdict::Doubtful => "doubtful",
        Verdict::Unusable => "unusable",
    }
}

/// The mean of a channel over the last seconds of a step; `None` where nothing was read.
pub(crate) fn at_end(recording: &Recording, marker: &StepMarker, channel: Channel) -> Option<f64> {
    let start_s = (marker.end_s - END_S).max(marker.start_s);
    let values = recording.series.get(&channel)?.slice(start_s, marker.end_s).1;
    mean(values).filter(|mean| mean.is_finite())
}
