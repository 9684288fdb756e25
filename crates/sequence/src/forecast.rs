//! What the nominal machine expects of each step, its housings' memory carried from step to step.

use crate::bench::Bench;
use mapper_core::Predicted;
use mapper_physics::model::State;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::simulate::{DEFAULT_RELATIVE_TOLERANCE, SimulationError, Simulator, Watch};
use mapper_physics::steady::SteadyState;

/// Interval of the forecast's samples, s.
const SAMPLE_S: f64 = 0.5;
/// Windows that follow the settling begin at the earliest this long after the jump, s, as in identification.
const EARLIEST_S: f64 = 10.0;
/// Shortest useful window, s, as in identification.
const SHORTEST_S: f64 = 30.0;
/// Most samples of a forecast; longer steps are sampled more coarsely.
const SAMPLE_LIMIT: f64 = 20_000.0;

#[derive(Clone, Copy)]
struct Sample {
    t_s: f64,
    speed_rpm: f64,
    flow_kg_s: f64,
    pressure_ratio: f64,
    t2_k: f64,
    tc_k: f64,
}

/// The nominal machine along a sequence.
pub(crate) struct Nominal {
    /// At the start of the current step; `None` before the first.
    state: Option<State>,
    /// Planned duration of the current step, s, and the state it would end in.
    planned: Option<(f64, State)>,
}

impl Nominal {
    pub(crate) fn new() -> Self {
        Nominal { state: None, planned: None }
    }

    /// What a step to `target` is expected to give.
    pub(crate) fn forecast(
        &mut self,
        bench: &Bench,
        target: &SteadyState,
        dwell_s: f64,
        has_jump: bool,
    ) -> Result<Predicted, SimulationError> {
        let state = match self.state {
            Some(state) => state,
            None => {
                let ambient_k = bench.boundary.ambient_temperature_k;
                let cold = State { tc_k: ambient_k, tt_k: ambient_k, ..target.state };
                run(bench, cold, &target.boundary, bench.warm_up_s, |_| {})?
            }
        };
        self.state = Some(state);
        let mut samples = Vec::new();
        let end = run(bench, state, &target.boundary, dwell_s, |sample| samples.push(sample))?;
        self.planned = Some((dwell_s, end));
        Ok(predicted(bench, &samples, dwell_s, has_jump))
    }

    /// The step has lasted `duration_s`.
    pub(crate) fn finish(
        &mut self,
        bench: &Bench,
        boundary: &BoundaryConditions,
        duration_s: f64,
    ) -> Result<(), SimulationError> {
        if let Some((planned_s, end)) = self.planned.take()
            && (planned_s - duration_s).abs() < SAMPLE_S
        {
            self.state = Some(end);
        } else if let Some(state) = self.state {
            self.state = Some(run(bench, state, boundary, duration_s, |_| {})?);
        }
        Ok(())
    }
}

fn run(
    bench: &Bench,
    state: State,
    boundary: &BoundaryConditions,
    duration_s: f64,
    mut on_sample: impl FnMut(Sample),
) -> Result<State, SimulationError> {
    let mut simulator =
        Simulator::new(&bench.model, 0.0, state, DEFAULT_RELATIVE_TOLERANCE, Watch::default());
    let interval_s = SAMPLE_S.max(duration_s / SAMPLE_LIMIT);
    let count = (duration_s / interval_s).floor() as usize;
    let times = (0..=count).map(|i| i as f64 * interval_s).filter(|t| *t < duration_s).chain([duration_s]);
    simulator.run_to(
        duration_s,
        boundary,
        times,
        |t_s, state, outputs| {
            on_sample(Sample {
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
    Ok(simulator.state())
}

fn predicted(bench: &Bench, samples: &[Sample], dwell_s: f64, has_jump: bool) -> Predicted {
    let settle_s = settle_s(bench, samples);
    let gradient = |value: fn(&Sample) -> f64| {
        let (start_s, end_s) = bench.window_s.unwrap_or_else(|| {
            let latest_s = (dwell_s - SHORTEST_S).max(EARLIEST_S);
            (settle_s.unwrap_or(latest_s).clamp(EARLIEST_S, latest_s), dwell_s)
        });
        let at = |t_s: f64| samples.iter().min_by(|a, b| (a.t_s - t_s).abs().total_cmp(&(b.t_s - t_s).abs()));
        (has_jump && start_s < dwell_s).then(|| Some(value(at(end_s)?) - value(at(start_s)?))).flatten()
    };
    let end = samples.last();
    Predicted {
        dt2_k: gradient(|sample| sample.t2_k),
        dtc_k: gradient(|sample| sample.tc_k),
        sigma_eta: None,
        sigma_h_rel: None,
        bias_eta: None,
        bias_h_rel: None,
        flow_kg_s: end.map_or(0.0, |sample| sample.flow_kg_s),
        pressure_ratio: end.map_or(1.0, |sample| sample.pressure_ratio),
        t2_k: end.map_or(0.0, |sample| sample.t2_k),
        settle_s,
        minutes: dwell_s / 60.0,
    }
}

/// From when on speed, flow and pressure ratio stay within their bands around the end value.
fn settle_s(bench: &Bench, samples: &[Sample]) -> Option<f64> {
    let (end, bands) = (samples.last()?, &bench.settle_bands);
    let within = |value: f64, end: f64, ratio: f64| (value - end).abs() <= ratio * end.abs();
    let last_outside = samples.iter().rposition(|sample| {
        !(within(sample.speed_rpm, end.speed_rpm, bands.speed_ratio)
            && within(sample.flow_kg_s, end.flow_kg_s, bands.flow_ratio)
            && within(sample.pressure_ratio, end.pressure_ratio, bands.pressure_ratio_ratio))
    });
    match last_outside {
        None => Some(0.0),
        Some(index) if index + 2 < samples.len() => samples.get(index + 1).map(|sample| sample.t_s),
        Some(_) => None,
    }
}
