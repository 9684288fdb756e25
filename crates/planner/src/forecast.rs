//! One step of the plan on the nominal machine, with its thermal memory.

use crate::request::{PlanRequest, PlanTiming, SettleBands};
use mapper_core::Predicted;
use mapper_physics::model::State;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::simulate::{DEFAULT_RELATIVE_TOLERANCE, SimulationError, Simulator, Watch};

/// Interval of the forecast's samples, s.
const SAMPLE_S: f64 = 0.5;

struct Sample {
    t_s: f64,
    speed_rpm: f64,
    flow_kg_s: f64,
    pressure_ratio: f64,
    t2_k: f64,
    tc_k: f64,
}

/// The machine after `duration_s` at `boundary`.
pub fn hold(
    request: &PlanRequest<'_>,
    state: State,
    boundary: &BoundaryConditions,
    duration_s: f64,
) -> Result<State, SimulationError> {
    let mut simulator =
        Simulator::new(request.model, 0.0, state, DEFAULT_RELATIVE_TOLERANCE, Watch::default());
    simulator.run_to(duration_s, boundary, [], |_, _, _| {}, |_| {})?;
    Ok(simulator.state())
}

/// What the step from `state` to `boundary` is expected to give, and the state at its end.
///
/// Gradients are `None` for the first step of a campaign, which has no jump.
pub fn forecast(
    request: &PlanRequest<'_>,
    state: State,
    boundary: &BoundaryConditions,
    has_jump: bool,
) -> Result<(Predicted, State), SimulationError> {
    let dwell_s = request.timing.dwell_s;
    let mut simulator =
        Simulator::new(request.model, 0.0, state, DEFAULT_RELATIVE_TOLERANCE, Watch::default());
    let mut samples: Vec<Sample> = Vec::new();
    let count = (dwell_s / SAMPLE_S).floor() as usize;
    // The step's own end is always the last sample.
    let times = (0..=count).map(|i| i as f64 * SAMPLE_S).filter(|t| *t < dwell_s).chain([dwell_s]);
    simulator.run_to(
        dwell_s,
        boundary,
        times,
        |t_s, state, outputs| {
            samples.push(Sample {
                t_s,
                speed_rpm: state.shaft_speed_rpm(),
                flow_kg_s: outputs.flow_kg_s,
                pressure_ratio: outputs.pressure_ratio,
                t2_k: outputs.t2_probe_k,
                tc_k: state.tc_k,
            });
        },
        |_| {},
    )?;
    let (Some(end), settle_s) = (samples.last(), settle_s(&samples, &request.settle_bands)) else {
        // The step's end is always sampled; an empty step has nothing to tell.
        return Ok((nothing(dwell_s), simulator.state()));
    };
    let gradient = |value: fn(&Sample) -> f64| {
        let (start_s, end_s) = window_s(&request.timing, settle_s)?;
        let at = |t_s: f64| samples.iter().min_by(|a, b| (a.t_s - t_s).abs().total_cmp(&(b.t_s - t_s).abs()));
        Some(value(at(end_s)?) - value(at(start_s)?))
    };
    let predicted = Predicted {
        dt2_k: gradient(|sample| sample.t2_k).filter(|_| has_jump),
        dtc_k: gradient(|sample| sample.tc_k).filter(|_| has_jump),
        sigma_eta: None,
        sigma_h_rel: None,
        flow_kg_s: end.flow_kg_s,
        pressure_ratio: end.pressure_ratio,
        t2_k: end.t2_k,
        settle_s,
        minutes: dwell_s / 60.0,
    };
    Ok((predicted, simulator.state()))
}

fn nothing(dwell_s: f64) -> Predicted {
    Predicted {
        dt2_k: None,
        dtc_k: None,
        sigma_eta: None,
        sigma_h_rel: None,
        flow_kg_s: 0.0,
        pressure_ratio: 1.0,
        t2_k: 0.0,
        settle_s: None,
        minutes: dwell_s / 60.0,
    }
}

/// The part of the step over which gradients are counted, s after the jump; `None` where it never settles.
fn window_s(timing: &PlanTiming, settle_s: Option<f64>) -> Option<(f64, f64)> {
    let start_s = timing.window_start_s.or(settle_s)?;
    Some((start_s, timing.window_end_s.unwrap_or(timing.dwell_s)))
}

/// From when on speed, flow and pressure ratio stay within their bands around the end value.
fn settle_s(samples: &[Sample], bands: &SettleBands) -> Option<f64> {
    let end = samples.last()?;
    let within = |value: f64, end: f64, ratio: f64| (value - end).abs() <= ratio * end.abs();
    let last_outside = samples.iter().rposition(|sample| {
        !(within(sample.speed_rpm, end.speed_rpm, bands.speed_ratio)
            && within(sample.flow_kg_s, end.flow_kg_s, bands.flow_ratio)
            && within(sample.pressure_ratio, end.pressure_ratio, bands.pressure_ratio_ratio))
    });
    match last_outside {
        None => Some(0.0),
        Some(index) if index + 2 < samples.len() => Some(samples[index + 1].t_s),
        Some(_) => None,
    }
}
