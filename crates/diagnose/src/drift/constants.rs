//! Constants of a campaign, each with its prior: they are not drift.

use crate::drift::drive::PERTURBATIONS;
use crate::drift::readings::{Readings, Response};
use crate::drift::runs::Segment;
use mapper_core::Channel;
use mapper_observe::channels::OUTPUTS;
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::Perturbation;

/// Factor on declared tolerances: repeats distinguish a constant from drift whatever its size, so a wide prior costs nothing. Bound: the
/// turbine housing, whose initial state takes an hour to decay, may start 20 K off.
const TOLERANCE_FACTOR: f64 = 4.0;

/// Deviations of each operating point from the smooth model, common to its repeats: one standard deviation. Judgement: a tenth to a
/// third of the declared tolerances, which hold for the whole machine.
const OWN_DEVIATIONS: [(Perturbation, f64); 4] = [
    (Perturbation::Efficiency, 0.005),
    (Perturbation::Flow, 0.004),
    (Perturbation::TurbineEfficiency, 0.006),
    (Perturbation::CompressorConvection, 0.03),
];

/// The same for a speed, rpm. Bound: the ripple of speed controllers.
const OWN_SPEED_RPM: f64 = 40.0;
/// The same for P2, Pa. Bound: the setting of a valve repeats to so much.
const OWN_P2_PA: f64 = 50.0;
/// The same for a flow, as a ratio of the reading. Bound: the linearity of flow meters.
const OWN_FLOW_RATIO: f64 = 1e-3;
/// The same for T2, for Tc, and for the turbine's temperatures, K. Bound: the error of a lumped housing at another point.
const OWN_T2_K: f64 = 0.1;
/// As [`OWN_T2_K`]. Bound: as there.
const OWN_TC_K: f64 = 0.2;
/// As [`OWN_T2_K`]. Bound: as there.
const OWN_TURBINE_K: f64 = 0.4;

/// The same for a channel with this reading, in its unit.
fn own_deviation(channel: Channel, reading: f64) -> f64 {
    match channel {
        Channel::ShaftSpeed => OWN_SPEED_RPM,
        Channel::P2 => OWN_P2_PA,
        Channel::CompressorFlow | Channel::TurbineFlow => OWN_FLOW_RATIO * reading,
        Channel::T2 => OWN_T2_K,
        Channel::Tc => OWN_TC_K,
        _ => OWN_TURBINE_K,
    }
}

/// Responses to all constants of a campaign, each of one standard deviation.
pub(crate) fn constants(readings: &Readings, declared: &Declared) -> Vec<Response> {
    let mut constants = Vec::new();
    for (perturbation, response) in PERTURBATIONS.iter().zip(&readings.responses) {
        let sigma = match perturbation {
            Perturbation::Input(channel) => {
                let level = readings.input_levels.get(channel).copied().unwrap_or(0.0);
                declared_error(declared, *channel, level)
            }
            perturbation => TOLERANCE_FACTOR * perturbation.tolerance(&declared.tolerances),
        };
        if sigma <= 0.0 {
            continue;
        }
        // Each run has its own initial state.
        let of_one_run = matches!(perturbation, Perturbation::StartTc | Perturbation::StartTt);
        for run in 0..if of_one_run { readings.runs } else { 1 } {
            let acts_in = |step: usize| !of_one_run || readings.steps[step].run == run;
            constants.push(response_in(readings, response, sigma, &acts_in));
        }
    }
    for (output, channel) in OUTPUTS.iter().enumerate() {
        let error = |reading: f64| declared_error(declared, *channel, reading);
        constants.push(channel_response(readings, output, &error, &|_| true));
    }
    let conditions = readings.steps.iter().map(|step| step.condition + 1).max().unwrap_or(0);
    for condition in 0..conditions {
        let acts_in = |step: usize| readings.steps[step].condition == condition;
        for (perturbation, sigma) in OWN_DEVIATIONS {
            if let Some(response) = readings.response(perturbation) {
                constants.push(response_in(readings, response, sigma, &acts_in));
            }
        }
        for (output, channel) in OUTPUTS.iter().enumerate() {
            let deviation = |reading: f64| own_deviation(*channel, reading);
            constants.push(channel_response(readings, output, &deviation, &acts_in));
        }
    }
    add_slow_variations(readings, declared, &mut constants);
    constants.retain(|constant| constant.iter().take(readings.row_count()).any(|value| *value != 0.0));
    constants
}

/// Declared constant error of a reading, one standard deviation.
fn declared_error(declared: &Declared, channel: Channel, reading: f64) -> f64 {
    declared.of(channel).fixed_sigma(channel, reading)
}

/// Knot distance of slow variations, s. Bound: several steps of a minute, so that variations explain no single step, and a fraction of the
/// hour in which turbine housings settle.
const KNOT_S: f64 = 480.0;
/// Slow variation of the turbine side, K. Bound: model errors of its housing take an hour to decay.
const TURBINE_VARIATION: [(Channel, f64); 2] = [(Channel::Tt, 0.2), (Channel::T4, 0.1)];
/// Maximum number of intervals between knots. Bound: effort; eight hours.
const MAX_INTERVALS: f64 = 60.0;

/// Adds time histories that are linear between knots: of the air around the housings, within its tolerance, and of the turbine side. No drift
/// has such a time history, so they do not hide one.
fn add_slow_variations(readings: &Readings, declared: &Declared, constants: &mut Vec<Response>) {
    let ambient_k = Perturbation::Ambient.tolerance(&declared.tolerances);
    let (start_s, end_s) = readings.span_s();
    let count = ((end_s - start_s) / KNOT_S).ceil().clamp(1.0, MAX_INTERVALS);
    for knot in 0..=count as usize {
        let hat = |segment: &Segment| {
            let t_s = 0.5 * (segment.start_s + segment.end_s) + readings.steps[segment.step].offset_s;
            let place = (t_s - start_s) / (end_s - start_s).max(1.0) * count;
            (1.0 - (place - knot as f64).abs()).max(0.0)
        };
        let variation = |value: &dyn Fn(usize, usize) -> f64| {
            readings.response_of_rows(|row, output| {
                let size = hat(&readings.segments[row / readings.columns.len()]);
                if size > 0.0 { size * value(row, output) } else { 0.0 }
            })
        };
        if let Some(ambient) = readings.response(Perturbation::Ambient) {
            constants.push(variation(&|row, _| ambient_k * ambient[row]));
        }
        for (channel, sigma) in TURBINE_VARIATION {
            constants.push(variation(&|_, output| if OUTPUTS[output] == channel { sigma } else { 0.0 }));
        }
    }
}

/// A response of this many units in some steps.
fn response_in(
    readings: &Readings,
    response: &Response,
    units: f64,
    acts_in: &dyn Fn(usize) -> bool,
) -> Response {
    let value = |position: usize| {
        if acts_in(readings.step_of(position)) { units * response[position] } else { 0.0 }
    };
    Response::from_fn(response.len(), |position, _| value(position))
}

/// An error of one channel in some steps; `error` of its reading.
fn channel_response(
    readings: &Readings,
    output: usize,
    error: &dyn Fn(f64) -> f64,
    acts_in: &dyn Fn(usize) -> bool,
) -> Response {
    readings.response_of_rows(|row, column| {
        if column == output && acts_in(readings.step_of(row)) { error(readings.model[row]) } else { 0.0 }
    })
}
