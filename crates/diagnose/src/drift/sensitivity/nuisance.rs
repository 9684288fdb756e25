//! Constants of a campaign, each with its prior: they are not drift.

use crate::drift::runs::time_axis::Block;
use crate::drift::sensitivity::knobs::{KNOBS, sigma};
use crate::drift::sensitivity::readings::{Constant, Readings};
use mapper_core::Channel;
use mapper_observe::channels::OUTPUTS;
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::Perturbation;

/// Deviations of each operating point from the smooth model, common to its repeats: one standard deviation.
const OWN_DEVIATIONS: [(Perturbation, f64); 4] = [
    (Perturbation::Efficiency, 0.005),
    (Perturbation::Flow, 0.004),
    (Perturbation::TurbineEfficiency, 0.006),
    (Perturbation::CompressorConvection, 0.03),
];

/// The same for each channel at each operating point, beyond the smooth model laws.
fn own_deviation(channel: Channel, level: f64) -> f64 {
    match channel {
        Channel::ShaftSpeed => 40.0,
        Channel::P2 => 50.0,
        Channel::CompressorFlow | Channel::TurbineFlow => 1e-3 * level,
        Channel::T2 => 0.1,
        Channel::Tc => 0.2,
        _ => 0.4,
    }
}

/// All constants of a campaign.
pub(crate) fn constants(readings: &Readings, declared: &Declared) -> Vec<Constant> {
    let mut constants = Vec::new();
    for (knob, answer) in KNOBS.iter().zip(&readings.answers) {
        let sigma = match knob {
            Perturbation::Input(channel) => {
                let declared = declared.of(*channel);
                declared.offset_sigma.hypot(declared.gain_sigma_ratio * readings.input_level(*channel))
            }
            knob => sigma(*knob, &declared.tolerances),
        };
        if sigma <= 0.0 {
            continue;
        }
        let of_runs = matches!(knob, Perturbation::StartTc | Perturbation::StartTt);
        for run in 0..if of_runs { readings.runs } else { 1 } {
            let holds = |step: usize| !of_runs || readings.steps[step].run == run;
            constants.push(scaled(readings, answer, sigma, &holds));
        }
    }
    for (column, channel) in OUTPUTS.iter().enumerate() {
        let declared = declared.of(*channel);
        let sigma = |level: f64| declared.offset_sigma.hypot(declared.gain_sigma_ratio * level);
        constants.push(channel_constant(readings, column, &sigma, &|_| true));
    }
    let conditions = readings.steps.iter().map(|step| step.condition + 1).max().unwrap_or(0);
    for condition in 0..conditions {
        let here = |step: usize| readings.steps[step].condition == condition;
        for (knob, sigma) in OWN_DEVIATIONS {
            if let Some(answer) = readings.answer(knob) {
                constants.push(scaled(readings, answer, sigma, &here));
            }
        }
        for (column, channel) in OUTPUTS.iter().enumerate() {
            constants.push(channel_constant(
                readings,
                column,
                &|level| own_deviation(*channel, level),
                &here,
            ));
        }
    }
    wander(readings, &mut constants);
    constants.retain(|constant| constant.readings.iter().any(|value| *value != 0.0));
    constants
}

/// Knot distance of slow wander, s.
const KNOT_S: f64 = 480.0;
/// Wander of the air around the housings, which is seldom recorded, K.
const AMBIENT_WANDER_K: f64 = 0.7;
/// Wander of the turbine side, K: model errors of its housing take an hour to decay.
const TURBINE_WANDER: [(Channel, f64); 2] = [(Channel::Tt, 0.2), (Channel::T4, 0.1)];

/// Time histories that are linear between knots, unlike the drifts considered.
fn wander(readings: &Readings, constants: &mut Vec<Constant>) {
    let (start_s, end_s) = readings.span_s();
    let count = ((end_s - start_s) / KNOT_S).ceil().clamp(1.0, 60.0);
    for knot in 0..=count as usize {
        let hat = |block: &Block| {
            let t_s = 0.5 * (block.start_s + block.end_s) + readings.steps[block.step].offset_s;
            let place = (t_s - start_s) / (end_s - start_s).max(1.0) * count;
            (1.0 - (place - knot as f64).abs()).max(0.0)
        };
        let columns = readings.columns.len();
        let steps = readings.steps.len();
        let course = |value: &dyn Fn(usize, usize) -> f64| {
            let readings = readings
                .blocks
                .iter()
                .enumerate()
                .flat_map(|(index, block)| {
                    let size = hat(block);
                    (0..columns).map(move |column| (index * columns + column, column, size))
                })
                .map(|(row, column, size)| if size > 0.0 { size * value(row, column) } else { 0.0 })
                .collect();
            Constant { readings, eta: vec![0.0; steps], h_w_m2k: vec![0.0; steps] }
        };
        if let Some(ambient) = readings.answer(Perturbation::Ambient) {
            constants.push(course(&|row, _| AMBIENT_WANDER_K * ambient.readings[row]));
        }
        for (channel, sigma) in TURBINE_WANDER {
            constants.push(course(&|_, column| {
                if OUTPUTS[readings.columns[column]] == channel { sigma } else { 0.0 }
            }));
        }
    }
}

fn scaled(readings: &Readings, answer: &Constant, sigma: f64, holds: &dyn Fn(usize) -> bool) -> Constant {
    let columns = readings.columns.len();
    let of_step = |values: &[f64]| {
        values.iter().enumerate().map(|(step, value)| if holds(step) { sigma * value } else { 0.0 }).collect()
    };
    Constant {
        readings: answer
            .readings
            .iter()
            .enumerate()
            .map(|(row, value)| if holds(readings.blocks[row / columns].step) { sigma * value } else { 0.0 })
            .collect(),
        eta: of_step(&answer.eta),
        h_w_m2k: of_step(&answer.h_w_m2k),
    }
}

fn channel_constant(
    readings: &Readings,
    output: usize,
    sigma: &dyn Fn(f64) -> f64,
    holds: &dyn Fn(usize) -> bool,
) -> Constant {
    let columns = readings.columns.len();
    let mut values = vec![0.0; readings.difference.len()];
    if let Some(column) = readings.columns.iter().position(|column| *column == output) {
        for (block, place) in readings.blocks.iter().enumerate() {
            if holds(place.step) {
                values[block * columns + column] = sigma(readings.model[block * columns + column]);
            }
        }
    }
    let steps = readings.steps.len();
    Constant { readings: values, eta: vec![0.0; steps], h_w_m2k: vec![0.0; steps] }
}
