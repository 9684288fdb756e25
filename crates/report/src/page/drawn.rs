//! Map, points and transients in display units, for the script of a page.

use crate::document::verdict_word;
use crate::formatting::{Display, Message};
use crate::point_results::points::{at_end, step_name};
use crate::test_report::run_report::RunReport;
use mapper_campaign::units::Kind;
use mapper_chart::MapDrawing;
use mapper_core::{
    Channel, CompressorMap, IdentifiedPoint, Recording, StepMarker, half_width_95, standard_error_of,
};
use mapper_identify::{DynamicEfficiency, FittedReadings};
use mapper_numerics::statistics::{mean, rms};
use serde::Serialize;

#[derive(Debug, Clone, Serialize, Default)]
pub(crate) struct DrawnMap {
    lines: Vec<DrawnLine>,
    contours: Vec<DrawnContour>,
    surge: Vec<[f64; 2]>,
    choke: Vec<[f64; 2]>,
    sought: Vec<DrawnMark>,
    soft: Vec<[f64; 2]>,
}

#[derive(Debug, Clone, Serialize)]
struct DrawnLine {
    speed: String,
    measured: bool,
    nodes: Vec<DrawnNode>,
    eta: Vec<DrawnEta>,
}

#[derive(Debug, Clone, Serialize)]
struct DrawnNode {
    flow: f64,
    pr: f64,
    out: bool,
}

/// Efficiency in % and the half width of its 95 % interval.
#[derive(Debug, Clone, Serialize)]
struct DrawnEta {
    flow: f64,
    eta: f64,
    half: f64,
}

#[derive(Debug, Clone, Serialize)]
struct DrawnContour {
    eta: f64,
    paths: Vec<Vec<[f64; 2]>>,
}

/// A measured surge-side end, with the half width of its 95 % interval.
#[derive(Debug, Clone, Serialize)]
struct DrawnMark {
    flow: f64,
    flow_half: f64,
    pr: f64,
}

pub(crate) fn drawn_map(map: &CompressorMap, display: &Display) -> DrawnMap {
    let flow = |kg_s: f64| rounded(display.number(Kind::MassFlow, kg_s));
    let place = |(kg_s, ratio): (f64, f64)| [flow(kg_s), rounded(ratio)];
    let places = |all: &[(f64, f64)]| all.iter().map(|one| place(*one)).collect::<Vec<_>>();
    let drawing = MapDrawing::new(map);
    let lines = drawing.lines.iter().map(|line| DrawnLine {
        speed: display.line_name(line.speed_corrected_rpm),
        measured: line.measured,
        nodes: line
            .nodes
            .iter()
            .map(|node| (place(node.place), node.extrapolated))
            .map(|([flow, pr], out)| DrawnNode { flow, pr, out })
            .collect(),
        eta: line
            .eta
            .iter()
            .map(|node| DrawnEta {
                flow: flow(node.flow_corrected_kg_s),
                eta: rounded(100.0 * node.eta),
                half: rounded(100.0 * half_width_95(node.eta_standard_error)),
            })
            .collect(),
    });
    DrawnMap {
        lines: lines.collect(),
        contours: drawing
            .contours()
            .iter()
            .map(|(eta, paths)| DrawnContour {
                eta: rounded(100.0 * eta),
                paths: paths.iter().map(|path| places(path)).collect(),
            })
            .collect(),
        surge: places(&drawing.surge),
        choke: places(&drawing.choke),
        soft: places(&drawing.soft),
        sought: drawing
            .sought
            .iter()
            .map(|mark| {
                let (low, high) = mark.x_interval.unwrap_or((mark.x, mark.x));
                DrawnMark {
                    flow: flow(mark.x),
                    flow_half: display.number(Kind::MassFlow, 0.5 * (high - low)),
                    pr: rounded(mark.y),
                }
            })
            .collect(),
    }
}

/// Rounds to four decimals: more are not visible on a screen, and took a third of the bytes.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

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
    dynamic: Option<[f64; 3]>,
    valve: Option<f64>,
    verdict: &'static str,
    repeat: bool,
    warnings: Vec<String>,
    raw: Vec<String>,
}

pub(crate) fn drawn_points(report: &RunReport<'_>, display: &Display) -> Vec<DrawnPoint> {
    let line_of = |step: usize| {
        let lines = report.results.map.into_iter().flat_map(|map| &map.lines);
        let own_points = lines.filter(|line| line.points.iter().any(|point| point.identified.step == step));
        own_points.map(|line| line.speed_corrected_rpm).next()
    };
    let points = report.results.identified();
    points
        .map(|point| {
            let rounded = line_of(point.step).unwrap_or(point.speed_corrected_rpm);
            let two = report.results.dynamic.iter().find(|two| two.step == point.step);
            let drawn = drawn_point(point, display.line_name(rounded), two, display);
            DrawnPoint { raw: raw(report, point.step, display), ..drawn }
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
        warnings: point.warnings.iter().map(Message::message).collect(),
        raw: Vec::new(),
    }
}

/// A half width of 0 means that no sensor is declared, not that it is perfect.
fn declared(half: f64) -> Option<f64> {
    (half > 0.0).then_some(half)
}

fn raw(report: &RunReport<'_>, step: usize, display: &Display) -> Vec<String> {
    let marker = report.recording.steps.iter().find(|marker| marker.index == step);
    let read = |channel| marker.and_then(|marker| at_end(report.recording, marker, channel));
    let shown = |channel: Channel| {
        let text = display.shown_reading(channel, read(channel)?);
        Some(format!("{channel} {text} {}", display.unit_of(channel)))
    };
    RAW.into_iter().filter_map(shown).collect()
}

/// Rows drawn per step: as many as a small plot has pixels.
const ROWS: usize = 120;

/// The drawn channels, in this order, and their names on the page.
const CHANNELS: [(Channel, &str); 8] = [
    (Channel::T2, "T2"),
    (Channel::Tc, "Tc"),
    (Channel::ShaftSpeed, "N"),
    (Channel::CompressorFlow, "m"),
    (Channel::P2, "P2"),
    (Channel::P3, "P3"),
    (Channel::T1, "T1"),
    (Channel::P1, "P1"),
];

/// One step; times are seconds after its change of setpoints.
#[derive(Serialize)]
pub(crate) struct DrawnStep {
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    step: usize,
    t: Vec<f64>,
    channels: Vec<DrawnChannel>,
    window: Option<[f64; 2]>,
    fits: Vec<DrawnFit>,
}

#[derive(Serialize)]
struct DrawnChannel {
    name: &'static str,
    unit: String,
    values: Vec<Option<f64>>,
}

/// A channel by the fit that gave the point, in the unit of temperatures, and its residual.
#[derive(Serialize)]
struct DrawnFit {
    channel: &'static str,
    t: Vec<f64>,
    fitted: Vec<f64>,
    left_k: Vec<f64>,
    rms_k: f64,
}

pub(crate) fn drawn_steps(report: &RunReport<'_>, display: &Display) -> Vec<DrawnStep> {
    let markers = report.recording.steps.iter();
    markers
        .filter_map(|marker| {
            let point = report.results.identified().find(|point| point.step == marker.index)?;
            let fitted = report.fitted.iter().find(|(step, _)| *step == marker.index);
            let fits = fitted.map_or(&[][..], |(_, fits)| fits);
            let window = point
                .window
                .map(|window| [window.start_s, window.end_s].map(|t_s| rounded(t_s - marker.start_s)));
            let fits = fits.iter().map(|fit| drawn_fit(fit, marker, display)).collect();
            Some(DrawnStep { window, fits, ..drawn_step(report.recording, marker, display) })
        })
        .collect()
}

fn drawn_step(recording: &Recording, marker: &StepMarker, display: &Display) -> DrawnStep {
    let width_s = (marker.end_s - marker.start_s) / ROWS as f64;
    let middle_s = |row: usize| (row as f64 + 0.5) * width_s;
    let channels = CHANNELS.iter().filter_map(|(channel, name)| {
        let series = recording.series.get(channel)?;
        let values = (0..ROWS).map(|row| {
            let start_s = marker.start_s + row as f64 * width_s;
            finite_mean(series.slice(start_s, start_s + width_s).1)
                .map(|value| rounded(display.reading(*channel, value)))
        });
        Some(DrawnChannel { name, unit: display.unit_of(*channel).to_owned(), values: values.collect() })
    });
    DrawnStep {
        step: marker.index,
        t: (0..ROWS).map(|row| rounded(middle_s(row))).collect(),
        channels: channels.collect(),
        window: None,
        fits: Vec::new(),
    }
}

fn drawn_fit(fit: &FittedReadings, marker: &StepMarker, display: &Display) -> DrawnFit {
    let rows = fit.t_s.len().min(ROWS);
    let bin = |row: usize| row * fit.t_s.len() / rows.max(1)..(row + 1) * fit.t_s.len() / rows.max(1);
    let column = |values: &[f64]| -> Vec<f64> {
        (0..rows).map(|row| values.get(bin(row)).and_then(finite_mean).unwrap_or(f64::NAN)).collect()
    };
    let left_k: Vec<f64> = fit.read_k.iter().zip(&fit.fitted_k).map(|(read, fitted)| read - fitted).collect();
    let shown = |k| rounded(display.number(Kind::Temperature, k));
    DrawnFit {
        channel: fit.channel.symbol(),
        t: column(&fit.t_s).into_iter().map(|t_s| rounded(t_s - marker.start_s)).collect(),
        fitted: column(&fit.fitted_k).into_iter().map(shown).collect(),
        left_k: column(&left_k).into_iter().map(rounded).collect(),
        rms_k: rounded(rms(&left_k).unwrap_or(0.0)),
    }
}

fn finite_mean(values: &[f64]) -> Option<f64> {
    mean(values).filter(|mean| mean.is_finite())
}
