//! The points by speed line, as in test reports: one table for report and page.

use crate::formatting::display::Display;
use crate::formatting::number::{number, percent};
use crate::point_results::end_readings::at_end;
use crate::point_results::points::{step_name, verdict_word};
use mapper_core::{Channel, CompressorMap, IdentifiedPoint, Recording, half_width_95};

/// A cell: its text, and its value if it is a number.
#[derive(Debug, Clone, PartialEq)]
pub struct PointCell {
    /// As displayed.
    pub text: String,
    /// In the internal unit.
    pub value: Option<f64>,
}

impl PointCell {
    fn new(text: String, value: f64) -> Self {
        PointCell { text, value: Some(value).filter(|value| value.is_finite()) }
    }

    fn nothing() -> Self {
        PointCell { text: "-".to_owned(), value: None }
    }
}

/// Points below one caption.
#[derive(Debug)]
pub struct PointGroup<'a> {
    /// Their common property.
    pub caption: String,
    pub points: Vec<&'a IdentifiedPoint>,
}

/// The points of each speed line from surge to choke, followed by the points outside the map.
pub fn point_groups<'a>(
    map: Option<&'a CompressorMap>,
    points: impl Iterator<Item = &'a IdentifiedPoint>,
    display: &Display,
) -> Vec<PointGroup<'a>> {
    let lines = map.map_or(&[][..], |map| map.lines.as_slice());
    let on_a_line =
        |step: usize| lines.iter().any(|line| line.points.iter().any(|point| point.identified.step == step));
    let mut groups: Vec<PointGroup<'a>> = lines
        .iter()
        .map(|line| {
            let mut points: Vec<&IdentifiedPoint> =
                line.points.iter().map(|point| &point.identified).collect();
            points.sort_by(|a, b| a.flow_corrected_kg_s.total_cmp(&b.flow_corrected_kg_s));
            let speed = display.line_name(line.speed_corrected_rpm);
            PointGroup { caption: format!("{speed} {} corrected", display.units().speed), points }
        })
        .collect();
    let others: Vec<&IdentifiedPoint> = points.filter(|point| !on_a_line(point.step)).collect();
    if !others.is_empty() {
        let caption = if lines.is_empty() { "Points" } else { "Repeats, and points that are not on the map" };
        groups.push(PointGroup { caption: caption.to_owned(), points: others });
    }
    groups
}

/// Heads of the table, with units.
pub fn point_heads(display: &Display) -> [String; 18] {
    [
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
    ]
}

/// The row of a point; the last cell is its verdict.
pub fn point_cells(recording: &Recording, point: &IdentifiedPoint, display: &Display) -> [PointCell; 18] {
    let marker = recording.steps.iter().find(|marker| marker.index == point.step);
    let read = |channel| marker.and_then(|marker| at_end(recording, marker, channel));
    let temperature =
        |k: Option<f64>| k.map_or_else(PointCell::nothing, |k| PointCell::new(display.temperature(k), k));
    let pressure =
        |pa: Option<f64>| pa.map_or_else(PointCell::nothing, |pa| PointCell::new(display.pressure(pa), pa));
    let optional = |text: String, value: Option<f64>| PointCell::new(text, value.unwrap_or(f64::NAN));
    // A half width of 0 means that no sensor is declared, not that it is perfect.
    let known =
        |half: f64, text: String| if half > 0.0 { PointCell::new(text, half) } else { PointCell::nothing() };
    let flow_half_kg_s =
        half_width_95(point.common.flow_corrected_standard_error_ratio) * point.flow_corrected_kg_s;
    let pr_half = half_width_95(point.common.pressure_ratio_standard_error);
    let (eta_half, h_half) = (point.eta_margin_95(), point.h_margin_95_w_m2k());
    let valve = point.valve_opening_ratio;
    [
        PointCell::new(step_name(point), point.step as f64),
        PointCell::new(display.speed(point.speed_rpm), point.speed_rpm),
        PointCell::new(display.speed(point.speed_corrected_rpm), point.speed_corrected_rpm),
        PointCell::new(number(Some(valve), 2), valve),
        PointCell::new(display.flow(point.flow_corrected_kg_s), point.flow_corrected_kg_s),
        known(flow_half_kg_s, display.flow(flow_half_kg_s)),
        PointCell::new(format!("{:.4}", point.pressure_ratio), point.pressure_ratio),
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
        PointCell { text: verdict_word(point.verdict).to_owned(), value: None },
    ]
}
