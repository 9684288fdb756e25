//! Forecast of one step on the nominal machine, with its thermal memory, for plan and sequence.

use crate::machine::params::BoundaryConditions;
use crate::operating_point::settled::{settled_count, with_bands};
use crate::operating_point::transition::TransitionInputs;
use crate::simulation::model::{Model, State};
use crate::simulation::simulate::{Crossing, DEFAULT_RELATIVE_TOLERANCE, SimulationError, Simulator, Watch};
use crate::simulation::steady::Inputs;
use mapper_core::{AvoidedCrossing, AvoidedSpeeds, AvoidedTime, Predicted, SettleBands, WindowRule};

/// Interval of a forecast's samples, s.
const SAMPLE_S: f64 = 0.5;
/// Maximum number of samples of a forecast; steps of more than 10 000 s are sampled more coarsely.
const MAX_SAMPLES: f64 = 20_000.0;

/// Samples for each row while P3 and valve move: speed and surge margin are judged ten times a second. Judgement: a tenth of a shaft's time constant.
const FINE_SAMPLES: usize = 5;
/// Time after the arrival of P3 and valve in which the shaft follows, s. Bound: the time constants of turbochargers are below a few seconds.
const FINE_AFTER_ARRIVAL_S: f64 = 5.0;

/// A row of a forecast: the machine at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForecastRow {
    /// Time after the jump, s.
    pub t_s: f64,
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Compressor flow, kg/s.
    pub flow_kg_s: f64,
    /// Inlet total temperature, K.
    pub t1_k: f64,
    /// Inlet total pressure, Pa.
    pub p1_pa: f64,
    /// Outlet total pressure, Pa.
    pub p2_pa: f64,
    /// Reading of the outlet probe, K.
    pub t2_k: f64,
    /// Compressor housing, K.
    pub tc_k: f64,
    /// The model's own efficiency, fraction.
    pub efficiency: f64,
    /// The model's own heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: f64,
}

/// A step of the nominal machine.
#[derive(Debug, Clone)]
pub struct StepForecast {
    /// Rows from the jump to the end; the last one is always the end.
    pub rows: Vec<ForecastRow>,
    /// Interval of the rows, s.
    pub interval_s: f64,
    /// The machine at the end.
    pub end: State,
    /// Highest shaft speed during the step, rpm.
    pub highest_speed_rpm: f64,
    /// Highest reading of the outlet probe during the step, K. Before the first row the probe still shows the previous point.
    pub highest_t2_k: f64,
    /// Lowest surge margin during the step: flow over the surge flow at equal corrected speed, minus one.
    pub lowest_surge_margin_ratio: f64,
    /// The slowest crossing of speeds to avoid.
    pub avoided: Option<AvoidedCrossing>,
}

/// The machine after `duration_s` at `boundary`.
pub fn hold(
    model: &Model,
    state: State,
    boundary: &BoundaryConditions,
    duration_s: f64,
) -> Result<State, SimulationError> {
    let mut simulator = Simulator::new(model, 0.0, state, DEFAULT_RELATIVE_TOLERANCE, Watch::default());
    simulator.run_to(duration_s, boundary, [], |_, _, _| {}, |_| {})?;
    Ok(simulator.state())
}

/// The machine after `warm_up_s` at its first point, from housings at ambient temperature; `first` is the
/// point's steady state.
pub fn warm_up_state(
    model: &Model,
    first: State,
    boundary: &BoundaryConditions,
    warm_up_s: f64,
) -> Result<State, SimulationError> {
    let ambient_k = boundary.ambient_temperature_k;
    hold(model, State { tc_k: ambient_k, tt_k: ambient_k, ..first }, boundary, warm_up_s)
}

/// The step of `dwell_s` from `state` under `inputs`, which move until `arrival_s`, and the time of its shaft inside the speeds to `avoid`.
pub fn forecast_step(
    model: &Model,
    state: State,
    inputs: &TransitionInputs,
    arrival_s: f64,
    dwell_s: f64,
    avoid: &AvoidedSpeeds,
) -> Result<StepForecast, SimulationError> {
    let mut simulator = Simulator::new(model, 0.0, state, DEFAULT_RELATIVE_TOLERANCE, Watch::default());
    let mut rows: Vec<ForecastRow> = Vec::new();
    let interval_s = SAMPLE_S.max(dwell_s / MAX_SAMPLES);
    let fine_end_s = arrival_s + FINE_AFTER_ARRIVAL_S;
    let times = sample_times(interval_s, fine_end_s, dwell_s);
    let mut are_rows = times.iter().map(|(_, is_row)| *is_row);
    let (mut lowest_margin_ratio, mut highest_rpm, mut highest_t2_k) = (f64::INFINITY, 0.0f64, 0.0f64);
    let (mut crossed, mut avoided) = (false, AvoidedTime::default());
    simulator.run_to(
        dwell_s,
        inputs,
        times.iter().map(|(t_s, _)| *t_s),
        |t_s, state, outputs| {
            let boundary = inputs.at(t_s);
            let speed_rpm = state.shaft_speed_rpm();
            let corrected_rpm = model.map.reference().corrected_speed_rpm(speed_rpm, boundary.t1_k);
            let margin_ratio = outputs.flow_corrected_kg_s / model.map.surge_point(corrected_rpm).0 - 1.0;
            lowest_margin_ratio = lowest_margin_ratio.min(margin_ratio);
            highest_rpm = highest_rpm.max(speed_rpm);
            avoided.add(avoid, t_s, speed_rpm);
            highest_t2_k = highest_t2_k.max(outputs.t2_probe_k);
            if are_rows.next() == Some(true) {
                rows.push(ForecastRow {
                    t_s,
                    speed_rpm,
                    flow_kg_s: outputs.flow_kg_s,
                    t1_k: boundary.t1_k,
                    p1_pa: boundary.p1_pa,
                    p2_pa: state.p2_pa,
                    t2_k: outputs.t2_probe_k,
                    tc_k: state.tc_k,
                    efficiency: outputs.efficiency,
                    h_w_m2k: outputs.h_w_m2k,
                });
            }
        },
        |event| crossed |= event.crossing == Crossing::SurgeEntered,
    )?;
    // A surge between two samples.
    if crossed {
        lowest_margin_ratio = lowest_margin_ratio.min(-f64::EPSILON);
    }
    Ok(StepForecast {
        highest_speed_rpm: highest_rpm,
        highest_t2_k,
        lowest_surge_margin_ratio: lowest_margin_ratio,
        avoided: avoided.slowest(avoid),
        end: simulator.state(),
        interval_s,
        rows,
    })
}

/// Times of the samples, and whether each is a row: rows at `interval_s` and at the end, finer samples until `fine_end_s`.
fn sample_times(interval_s: f64, fine_end_s: f64, dwell_s: f64) -> Vec<(f64, bool)> {
    let fine_s = interval_s / FINE_SAMPLES as f64;
    let count = (dwell_s / fine_s).floor() as usize;
    let is_wanted = |(t_s, is_row): &(f64, bool)| *t_s < dwell_s && (*is_row || *t_s < fine_end_s);
    let times = (0..=count).map(|i| match (i / FINE_SAMPLES, i % FINE_SAMPLES) {
        (row, 0) => (row as f64 * interval_s, true),
        _ => (i as f64 * fine_s, false),
    });
    times.filter(is_wanted).chain([(dwell_s, true)]).collect()
}

impl StepForecast {
    /// Time at which the operating point has settled, s after the jump; `None` if it has not settled before the
    /// last interval. [`crate::operating_point::settled`] defines settling.
    pub fn settle_s(&self, bands: &SettleBands) -> Option<f64> {
        type Signal = fn(&ForecastRow) -> f64;
        let signals = with_bands::<Signal>(
            |row| row.speed_rpm,
            |row| row.flow_kg_s,
            |row| row.p2_pa / row.p1_pa,
            bands,
        );
        let settled = signals
            .into_iter()
            .map(|(_, signal, allowed_ratio)| {
                settled_count(self.rows.iter().rev().map(signal), allowed_ratio, 0.0)
            })
            .min()?;
        (settled > 1).then(|| self.rows.get(self.rows.len() - settled)).flatten().map(|row| row.t_s)
    }

    /// The rows from `start_s` to `end_s` after the jump.
    pub fn window(&self, (start_s, end_s): (f64, f64)) -> &[ForecastRow] {
        // Half an interval of slack for rounding.
        let slack_s = 0.5 * self.interval_s;
        let first = self.rows.partition_point(|row| row.t_s <= start_s - slack_s);
        let end = self.rows.partition_point(|row| row.t_s < end_s + slack_s);
        self.rows.get(first..end).unwrap_or_default()
    }

    /// The expected results of the step, without the errors of an identification. Without a jump (the first step of a
    /// campaign) the gradients are missing.
    pub fn predicted(&self, rule: &WindowRule, bands: &SettleBands, has_jump: bool) -> Predicted {
        // An empty step has no results.
        let (end, dwell_s) = (self.rows.last(), self.rows.last().map_or(0.0, |row| row.t_s));
        let settle_s = self.settle_s(bands);
        let window = if has_jump { self.window(rule.of_step_s(settle_s, dwell_s)) } else { &[] };
        let change = |value: fn(&ForecastRow) -> f64| Some(value(window.last()?) - value(window.first()?));
        let (flow_kg_s, pressure_ratio, t2_k) =
            end.map_or((0.0, 1.0, 0.0), |row| (row.flow_kg_s, row.p2_pa / row.p1_pa, row.t2_k));
        Predicted {
            dt2_k: change(|row| row.t2_k),
            dtc_k: change(|row| row.tc_k),
            settle_s,
            ..Predicted::settled(flow_kg_s, pressure_ratio, t2_k, dwell_s)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::steady::hold_speed;

    #[test]
    fn a_machine_that_rests_has_settled_at_once_and_gains_nothing() {
        let model = Model::nominal();
        let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..BoundaryConditions::default() };
        let rest = hold_speed(&model, 110e3, &boundary).unwrap();
        let forecast = forecast_step(
            &model,
            rest.state,
            &TransitionInputs::constant(&rest.boundary),
            0.0,
            120.0,
            &AvoidedSpeeds::NONE,
        )
        .unwrap();
        let predicted = forecast.predicted(&WindowRule::Auto, &SettleBands::default(), true);
        assert_eq!(predicted.settle_s, Some(0.0));
        // The integration's tolerance of 1e-6 at 400 K.
        assert!(predicted.dtc_k.unwrap().abs() < 1e-2 && predicted.dt2_k.unwrap().abs() < 1e-2);
        let first = forecast.predicted(&WindowRule::Auto, &SettleBands::default(), false);
        assert_eq!((first.dt2_k, first.dtc_k), (None, None), "no jump, no gradient");
    }

    #[test]
    fn a_window_holds_its_ends() {
        let model = Model::nominal();
        let boundary = BoundaryConditions { valve_opening_ratio: 0.7, ..BoundaryConditions::default() };
        let rest = hold_speed(&model, 110e3, &boundary).unwrap();
        let forecast = forecast_step(
            &model,
            rest.state,
            &TransitionInputs::constant(&rest.boundary),
            0.0,
            120.0,
            &AvoidedSpeeds::NONE,
        )
        .unwrap();
        let window = forecast.window((10.0, 110.0));
        assert_eq!((window[0].t_s, window[window.len() - 1].t_s), (10.0, 110.0));
        assert!(forecast.window((130.0, 140.0)).is_empty());
    }
}
