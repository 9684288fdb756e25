//! One step of the plan on the nominal machine, with its thermal memory.

use crate::method::ForecastRow;
use crate::request::{PlanRequest, PlanTiming, SettleBands};
use mapper_core::Predicted;
use mapper_physics::model::State;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::simulate::{Crossing, DEFAULT_RELATIVE_TOLERANCE, SimulationError, Simulator, Watch};

/// Interval of the forecast's samples, s.
const SAMPLE_S: f64 = 0.5;
/// Windows that follow the settling begin at the earliest this long after the jump, s, as in identification.
const EARLIEST_S: f64 = 10.0;
/// Shortest useful window, s, as in identification.
const SHORTEST_S: f64 = 30.0;

/// A step as it is expected to go.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Forecast {
    pub(crate) predicted: Predicted,
    pub(crate) end: State,
    /// Housing at the window's start, K.
    pub(crate) highest_speed_rpm: f64,
    pub(crate) highest_t2_k: f64,
    /// Longest stretch beyond the surge line, s.
    pub(crate) longest_surge_s: f64,
}

/// The machine after `duration_s` at `boundary`.
pub(crate) fn hold(
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
pub(crate) fn forecast(
    request: &PlanRequest<'_>,
    state: State,
    boundary: &BoundaryConditions,
    dwell_s: f64,
    has_jump: bool,
) -> Result<Forecast, SimulationError> {
    let mut simulator =
        Simulator::new(request.model, 0.0, state, DEFAULT_RELATIVE_TOLERANCE, Watch::default());
    let mut rows: Vec<ForecastRow> = Vec::new();
    let (mut surge_since_s, mut longest_surge_s) = (None, 0.0f64);
    let count = (dwell_s / SAMPLE_S).floor() as usize;
    // The step's own end is always the last sample.
    let times = (0..=count).map(|i| i as f64 * SAMPLE_S).filter(|t| *t < dwell_s).chain([dwell_s]);
    simulator.run_to(
        dwell_s,
        boundary,
        times,
        |t_s, state, outputs| {
            rows.push(ForecastRow {
                t_s,
                speed_rpm: state.shaft_speed_rpm(),
                flow_kg_s: outputs.flow_kg_s,
                t1_k: boundary.t1_k,
                p1_pa: boundary.p1_pa,
                p2_pa: state.p2_pa,
                t2_k: outputs.t2_probe_k,
                tc_k: state.tc_k,
                efficiency: outputs.efficiency,
                h_w_m2k: outputs.h_w_m2k,
            });
        },
        |event| match event.crossing {
            Crossing::SurgeEntered => surge_since_s = Some(event.t_s),
            Crossing::SurgeLeft => {
                longest_surge_s = longest_surge_s.max(event.t_s - surge_since_s.take().unwrap_or(0.0));
            }
            Crossing::OverspeedEntered | Crossing::OverspeedLeft => {}
        },
    )?;
    if let Some(since_s) = surge_since_s {
        longest_surge_s = longest_surge_s.max(dwell_s - since_s);
    }
    let highest = |value: fn(&ForecastRow) -> f64| rows.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
    Ok(Forecast {
        predicted: predicted(request, &rows, dwell_s, has_jump),
        end: simulator.state(),
        highest_speed_rpm: highest(|row| row.speed_rpm),
        // Before the first sample the probe still shows the point before.
        highest_t2_k: highest(|row| row.t2_k),
        longest_surge_s,
    })
}

fn predicted(request: &PlanRequest<'_>, rows: &[ForecastRow], dwell_s: f64, has_jump: bool) -> Predicted {
    let settle_s = settle_s(rows, &request.settle_bands);
    let mut predicted = Predicted {
        dt2_k: None,
        dtc_k: None,
        sigma_eta: None,
        sigma_h_rel: None,
        bias_eta: None,
        bias_h_rel: None,
        flow_kg_s: 0.0,
        pressure_ratio: 1.0,
        t2_k: 0.0,
        settle_s,
        minutes: dwell_s / 60.0,
    };
    // The step's end is always sampled; an empty step has nothing to tell.
    let Some(end) = rows.last() else { return predicted };
    predicted.flow_kg_s = end.flow_kg_s;
    predicted.pressure_ratio = end.p2_pa / end.p1_pa;
    predicted.t2_k = end.t2_k;
    let (start_s, end_s) = window_s(&request.timing, settle_s, dwell_s);
    // Half a sample of slack for rounding.
    let window: Vec<ForecastRow> = rows
        .iter()
        .filter(|row| row.t_s > start_s - 0.5 * SAMPLE_S && row.t_s < end_s + 0.5 * SAMPLE_S)
        .copied()
        .collect();
    let (Some(first), Some(last), true) = (window.first(), window.last(), has_jump) else { return predicted };
    predicted.dt2_k = Some(last.t2_k - first.t2_k);
    predicted.dtc_k = Some(last.tc_k - first.tc_k);
    if let Some(found) = request.method.and_then(|method| method.predict(&window, SAMPLE_S)) {
        let mean =
            |value: fn(&ForecastRow) -> f64| window.iter().map(value).sum::<f64>() / window.len() as f64;
        let (own_eta, own_h) = (mean(|row| row.efficiency), mean(|row| row.h_w_m2k));
        predicted.sigma_eta = Some(found.sigma_eta);
        predicted.sigma_h_rel = Some(found.sigma_h_w_m2k / own_h);
        predicted.bias_eta = Some(found.eta - own_eta);
        predicted.bias_h_rel = Some(found.h_w_m2k / own_h - 1.0);
    }
    predicted
}

/// The part of the step over which gradients are counted, s after the jump, as identification will choose it.
pub(crate) fn window_s(timing: &PlanTiming, settle_s: Option<f64>, dwell_s: f64) -> (f64, f64) {
    let end_s = timing.window_end_s.unwrap_or(dwell_s).min(dwell_s);
    let settled_s = || {
        let latest_s = (dwell_s - SHORTEST_S).max(EARLIEST_S);
        settle_s.unwrap_or(latest_s).clamp(EARLIEST_S, latest_s)
    };
    (timing.window_start_s.unwrap_or_else(settled_s), end_s)
}

/// From when to the step's end speed, flow and pressure ratio vary by no more than their bands; `None` where that is
/// never the case for longer than the last sample.
fn settle_s(rows: &[ForecastRow], bands: &SettleBands) -> Option<f64> {
    type Signal = fn(&ForecastRow) -> f64;
    let signals: [(Signal, f64); 3] = [
        (|row| row.speed_rpm, bands.speed_ratio),
        (|row| row.flow_kg_s, bands.flow_ratio),
        (|row| row.p2_pa / row.p1_pa, bands.pressure_ratio_ratio),
    ];
    let mut settled = 0;
    for (signal, allowed_ratio) in signals {
        let (mut low, mut high, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for (count, (index, row)) in rows.iter().enumerate().rev().enumerate() {
            let value = signal(row);
            (low, high, sum) = (low.min(value), high.max(value), sum + value);
            if high - low > allowed_ratio * (sum / (count + 1) as f64).abs() {
                settled = settled.max(index + 1);
                break;
            }
        }
    }
    (settled + 1 < rows.len()).then(|| rows[settled].t_s)
}
