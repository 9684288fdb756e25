//! Points in the form that the script draws, in display units.

use crate::page::run_page::RunPage;
use crate::{Display, at_end, step_name, verdict_word, warning_text};
use mapper_campaign::units::Kind;
use mapper_core::{Channel, IdentifiedPoint, half_width_95, standard_error_of};
use mapper_identify::DynamicEfficiency;
use serde::Serialize;

/// Channels whose readings are shown with a point.
const RAW: [Channel; 9] = [
    Channel::ShaftSpeed,
    Channel::CompressorFlow,
    Channel::T1,
    Channel::P1,
    Channel::T2,
    Channel::P2,
    Channel::Tc,
    Channel::P3,
    Channel::T3,
];

/// One point. Efficiencies in %, half widths of 95 % intervals in points.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct DrawnPoint {
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    step: usize,
    name: String,
    /// Corrected speed of its line, as text.
    line: String,
    speed: f64,
    flow: f64,
    pr: f64,
    /// Half widths of 95 % intervals; `None` if no sensors are declared.
    flow_half: Option<f64>,
    pr_half: Option<f64>,
    eta: Option<f64>,
    eta_low: Option<f64>,
    eta_high: Option<f64>,
    /// Contributions to the half width: common to all points, and of this point alone.
    eta_common: Option<f64>,
    eta_own: Option<f64>,
    h: Option<f64>,
    h_low: Option<f64>,
    h_high: Option<f64>,
    /// Result of the dynamic method.
    dynamic: Option<[f64; 3]>,
    valve: Option<f64>,
    verdict: &'static str,
    repeat: bool,
    warnings: Vec<String>,
    /// Readings at the end of the step, as displayed.
    raw: Vec<String>,
}

/// All points, repeats included.
pub(crate) fn drawn_points(page: &RunPage<'_>, display: &Display) -> Vec<DrawnPoint> {
    let line_of = |step: usize| {
        let lines = page.report.map.into_iter().flat_map(|map| &map.lines);
        let own_points = lines.filter(|line| line.points.iter().any(|point| point.identified.step == step));
        own_points.map(|line| line.speed_corrected_rpm).next()
    };
    let points = page.report.identified();
    points
        .map(|point| {
            let rounded = line_of(point.step).unwrap_or(point.speed_corrected_rpm);
            let two = page.report.dynamic.iter().find(|two| two.step == point.step);
            let drawn = drawn_point(point, display.line_name(rounded), two, display);
            DrawnPoint { raw: raw(page, point.step, display), ..drawn }
        })
        .collect()
}

/// A point on a line; `two`: its result by the dynamic method.
pub(crate) fn drawn_point(
    point: &IdentifiedPoint,
    line: String,
    two: Option<&DynamicEfficiency>,
    display: &Display,
) -> DrawnPoint {
    let percent = |value: Option<f64>| value.map(|value| 100.0 * value);
    let interval = point.eta_low.zip(point.eta_high).map(|(low, high)| standard_error_of(low, high));
    DrawnPoint {
        step: point.step,
        name: step_name(point),
        line,
        speed: display.number(Kind::Speed, point.speed_corrected_rpm),
        flow: display.number(Kind::MassFlow, point.flow_corrected_kg_s),
        pr: point.pressure_ratio,
        flow_half: declared(
            half_width_95(point.common.flow_corrected_standard_error_ratio)
                * display.number(Kind::MassFlow, point.flow_corrected_kg_s),
        ),
        pr_half: declared(half_width_95(point.common.pressure_ratio_standard_error)),
        eta: percent(point.eta),
        eta_low: percent(point.eta_low),
        eta_high: percent(point.eta_high),
        eta_common: interval.map(|_| 100.0 * half_width_95(point.common.eta_standard_error())),
        eta_own: percent(point.eta_own_standard_error()).map(half_width_95),
        h: point.h_w_m2k,
        h_low: point.h_low_w_m2k,
        h_high: point.h_high_w_m2k,
        dynamic: two.map(|two| [two.eta, two.eta_low, two.eta_high].map(|value| 100.0 * value)),
        valve: point.valve_opening_ratio.is_finite().then_some(point.valve_opening_ratio),
        verdict: verdict_word(point.verdict),
        repeat: !point.kind.measures(),
        warnings: point.warnings.iter().map(warning_text).collect(),
        raw: Vec::new(),
    }
}

/// A half width of 0 means that no sensor is declared, not that it is perfect.
fn declared(half: f64) -> Option<f64> {
    (half > 0.0).then_some(half)
}

/// Readings at the end of a step: symbol, value and unit.
fn raw(page: &RunPage<'_>, step: usize, display: &Display) -> Vec<String> {
    let marker = page.report.recording.steps.iter().find(|marker| marker.index == step);
    let read = |channel| marker.and_then(|marker| at_end(page.report.recording, marker, channel));
    let shown = |channel: Channel| {
        let text = display.shown_reading(channel, read(channel)?);
        Some(format!("{channel} {text} {}", display.unit_of(channel)))
    };
    RAW.into_iter().filter_map(shown).collect()
}
