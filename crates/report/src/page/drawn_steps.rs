//! Readings of each step, thinned for drawing.

use crate::Display;
use crate::page::drawn_map::rounded;
use crate::page::run_page::RunPage;
use mapper_campaign::units::Kind;
use mapper_core::{Channel, Recording, StepMarker};
use mapper_identify::T2History;
use mapper_numerics::statistics::{mean, rms};
use serde::Serialize;

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
    model: Option<DrawnModel>,
}

#[derive(Serialize)]
struct DrawnChannel {
    name: &'static str,
    unit: String,
    values: Vec<Option<f64>>,
}

/// T2 by the point's numbers and its residual, in the unit of temperatures and in K.
#[derive(Serialize)]
struct DrawnModel {
    t: Vec<f64>,
    t2: Vec<f64>,
    left_k: Vec<f64>,
    rms_k: f64,
    shift_k: f64,
}

/// All steps that a point was identified from.
pub(crate) fn drawn_steps(page: &RunPage<'_>, display: &Display) -> Vec<DrawnStep> {
    let markers = page.report.recording.steps.iter();
    markers
        .filter_map(|marker| {
            let point = page.report.identified().find(|point| point.step == marker.index)?;
            let history = page.t2_histories.iter().find(|history| history.step == marker.index);
            let window = point
                .window
                .map(|window| [window.start_s, window.end_s].map(|t_s| rounded(t_s - marker.start_s)));
            let model = history.map(|history| drawn_model(history, marker, display));
            Some(DrawnStep { window, model, ..drawn_step(page.report.recording, marker, display) })
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
        model: None,
    }
}

fn drawn_model(history: &T2History, marker: &StepMarker, display: &Display) -> DrawnModel {
    let rows = history.t_s.len().min(ROWS);
    let bin = |row: usize| row * history.t_s.len() / rows.max(1)..(row + 1) * history.t_s.len() / rows.max(1);
    let column = |values: &[f64]| -> Vec<f64> {
        (0..rows).map(|row| values.get(bin(row)).and_then(finite_mean).unwrap_or(f64::NAN)).collect()
    };
    let left_k: Vec<f64> =
        history.read_k.iter().zip(&history.model_k).map(|(read, model)| read - model).collect();
    let rms_k = rms(&left_k).unwrap_or(0.0);
    DrawnModel {
        t: column(&history.t_s).into_iter().map(|t_s| rounded(t_s - marker.start_s)).collect(),
        t2: column(&history.model_k)
            .into_iter()
            .map(|k| rounded(display.number(Kind::Temperature, k)))
            .collect(),
        left_k: column(&left_k).into_iter().map(rounded).collect(),
        rms_k: rounded(rms_k),
        shift_k: rounded(history.shift_k),
    }
}

fn finite_mean(values: &[f64]) -> Option<f64> {
    mean(values).filter(|mean| mean.is_finite())
}
