//! Predicts the readings of T2 and Tc along a step for given parameters, with their derivatives.
//!
//! T2 follows from eqs. 1-3 and the probe. Tc is its own change: the heat to the housing, integrated over the window and divided by the heat
//! capacity. A housing of one node touches the gas with Tc. One of two nodes touches it with an inner wall of temperature Ti:
//!
//! ```text
//! phi C dTi/dt = q1 + q2 - G (Ti - Tc)      (1 - phi) C dTc/dt = G (Ti - Tc) + q_inlet + Q + w
//! ```
//!
//! Ti is integrated through the whole run, jumps included, with the measured Tc: it remembers the point before, and neither warms up nor cools down
//! when the run begins. Each parameter acts on a row by a few inputs of the gas path and of the housing; the chain rule gives its column, through
//! wall, probe and integral.

use crate::joint::step_model::gas_path::{Inputs, Slopes, Wanted};
use crate::joint::step_model::linearised::{
    Linearised, Model, RowState, StepHistory, WallRow, surface_of, tc_error_k,
};
use crate::joint::step_model::parameters::{
    ALPHA, BAROMETER, ETA, FIRST_READING, FLOW_GAIN, GAINS, HUMIDITY, INLET, LN_CAPACITY, LN_DEVIATION,
    LN_HEATING_COOLING_RATIO, LN_INNER_CONDUCTANCE, LOCAL, LOGIT_INNER, LocalVector, OFFSETS, PREHEAT,
    PROBE_MM2, SHARED, STEP_HEAT, SharedVector, TC_LAG, TERM_COUNT, THERMOMETERS, dot,
};
use crate::joint::step_model::rows::{MAX_ROW_GAP_S, Row};
use mapper_physics::rig::sensor_fault::ExactReadings;

/// Exponent below which the mean over a row replaces the formula. Bound: the next term is below rounding.
const SERIES_BELOW: f64 = 1e-6;
/// Iterations to the temperature of a settled wall. Bound: each reduces its distance, some 10 K, at least tenfold.
const SETTLED_ROUNDS: usize = 3;

/// Inner wall at the end of a step, and its derivatives by the shared parameters.
#[derive(Debug, Clone)]
pub(crate) struct Wall {
    t_s: f64,
    wall_k: f64,
    by_shared: Box<SharedVector>,
}

/// Predicted readings, first T2, then Tc if the balance is an observation, with one column per parameter: shared ones first, then those of the
/// step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Prediction {
    pub(crate) readings_k: Vec<f64>,
    pub(crate) columns: Vec<Vec<f64>>,
    pub(crate) wall: Option<Wall>,
}

/// Convection at the end of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepEnd {
    /// h after the wheel, W/(m2 K).
    pub(crate) h_w_m2k: f64,
    /// ln of the Reynolds number over the reference.
    pub(crate) ln_reynolds: f64,
    /// ln of the ratio of h before the wheel to h after it by the inlet's own law.
    pub(crate) ln_inlet_ratio: f64,
}

/// Share of the heat capacity in the inner wall, and its conductance, W/K.
pub(crate) fn inner_wall(shared: &SharedVector) -> (f64, f64) {
    (1.0 / (1.0 + (-shared[LOGIT_INNER]).exp()), shared[LN_INNER_CONDUCTANCE].exp())
}

/// Tc without its errors, K.
fn outer_k(row: &Row, shared: &SharedVector, exact_at: ExactReadings) -> f64 {
    row.tc_k + shared[TC_LAG] * row.tc_slope_k_s - tc_error_k(row.tc_k, shared, exact_at)
}

/// Error of T2 at the temperature of its probe's tip, K. At the reading, the noise would be part of the prediction, and a gain would be fitted to it.
fn t2_error_k(probe_k: f64, shared: &SharedVector, exact_at: ExactReadings) -> f64 {
    shared[OFFSETS + 1] + shared[THERMOMETERS] + shared[GAINS] * (probe_k - exact_at.temperature_k)
}

/// Mean of `exp(-x s)` over s from 0 to 1.
fn mean_decay(x: f64) -> f64 {
    if x.abs() < SERIES_BELOW { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
}

impl Model {
    fn inputs(
        &self,
        row: &Row,
        terms: &[f64; TERM_COUNT],
        shared: &SharedVector,
        local: &LocalVector,
    ) -> Inputs {
        let exact_at = self.setting.exact_at;
        let outer_k = outer_k(row, shared, exact_at);
        let [p1_pa, p2_pa] = pressures_pa(row, shared, exact_at.pressure_pa);
        Inputs {
            t1_k: row.t1_k - shared[OFFSETS] - shared[THERMOMETERS],
            wall_k: outer_k,
            outer_k,
            p1_pa,
            p2_pa,
            flow_kg_s: row.flow_kg_s / (1.0 + shared[FLOW_GAIN]),
            eta: local[ETA] + dot(terms, surface_of(shared)),
            ln_h: local[LN_DEVIATION],
            alpha_area_ratio: shared[ALPHA],
            ln_heating_cooling_ratio: shared[LN_HEATING_COOLING_RATIO],
            preheat_w_k: shared[PREHEAT],
            inlet_power: shared[INLET],
            humidity_kg_kg: shared[HUMIDITY],
        }
    }

    /// The gas at a step's end, with the wall at the temperature of the outer part.
    pub(crate) fn at_end(&self, end: &Row, shared: &SharedVector, local: &LocalVector) -> StepEnd {
        let inputs = self.inputs(end, &[0.0; TERM_COUNT], shared, local);
        let path = self.setting.gas_path(&inputs, shared);
        StepEnd {
            h_w_m2k: path.h_w_m2k,
            ln_reynolds: self.setting.ln_reynolds(&inputs, &path),
            ln_inlet_ratio: self.setting.ln_inlet_ratio(&inputs, &path, shared),
        }
    }

    /// Predicts the readings, with derivatives by the parameters in `active` and by those of the step if `derivatives` is set. `before`: the
    /// inner wall at the end of the step before.
    pub(crate) fn predict(
        &self,
        history: &StepHistory<'_>,
        (shared, local): (&SharedVector, &LocalVector),
        active: &[bool; SHARED],
        derivatives: bool,
        before: Option<&Wall>,
    ) -> Prediction {
        let (linearised, start, end_k) = {
            let wanted = if active[INLET] || active[HUMIDITY] { Wanted::Model } else { Wanted::Law };
            self.linearised(history, (shared, local), derivatives.then_some(wanted), before, (false, None))
        };
        let mut readings_k = linearised.probe.read(&linearised.gas_k, local[FIRST_READING]);
        let exact_at = self.setting.exact_at;
        readings_k.iter_mut().for_each(|reading_k| *reading_k += t2_error_k(*reading_k, shared, exact_at));
        if self.has_balance {
            readings_k.extend(linearised.tc_k(shared));
        }
        let mut prediction = Prediction { readings_k, columns: Vec::new(), wall: None };
        let last_s = history.step.rows.last().map_or(f64::NAN, |row| row.t_s);
        let mut by_shared = Box::new([0.0; SHARED]);
        if derivatives {
            prediction.columns = vec![Vec::new(); SHARED + LOCAL];
            for index in (0..SHARED).filter(|index| active[*index]) {
                let start_by = start.as_ref().map(|wall| wall.by_shared[index]);
                let (column, end_by) = linearised.by_shared(index, history, shared, local, start_by);
                prediction.columns[index] = column;
                by_shared[index] = end_by;
            }
            for index in 0..LOCAL {
                prediction.columns[SHARED + index] = linearised.by_local(index);
            }
        }
        prediction.wall = self.has_inner_wall.then_some(Wall { t_s: last_s, wall_k: end_k, by_shared });
        prediction
    }

    /// The states along a step, the wall it starts from, and the wall at its end, K. `derivatives`: see [`Setting::slopes`]. `known`: the same
    /// step with other parameters of the law, with the paths that it keeps.
    pub(crate) fn linearised<'a>(
        &'a self,
        history: &StepHistory<'a>,
        (shared, local): (&SharedVector, &LocalVector),
        derivatives: Option<Wanted>,
        before: Option<&Wall>,
        (keeps, known): (bool, Option<&Linearised<'_>>),
    ) -> (Linearised<'a>, Option<Wall>, f64) {
        let step = history.step;
        let skipped = if self.has_inner_wall { 0 } else { step.lead.len() };
        let rows: Vec<&Row> = step.lead.iter().chain(&step.rows).skip(skipped).collect();
        let inner = inner_wall(shared);
        let start = before.filter(|wall| rows.first().is_some_and(|row| row.t_s - wall.t_s < MAX_ROW_GAP_S));
        let first_terms = history.terms.get(skipped).unwrap_or(&[0.0; TERM_COUNT]);
        let settled_k = |row: &&Row| {
            let inputs = self.inputs(row, first_terms, shared, local);
            if self.has_inner_wall { self.settled_wall_k(inputs, inner, shared) } else { inputs.outer_k }
        };
        let mut wall_k = start.map_or_else(|| rows.first().map_or(f64::NAN, settled_k), |wall| wall.wall_k);
        let mut states = Vec::with_capacity(rows.len());
        for (i, row) in rows.iter().enumerate() {
            let terms = history.terms.get(skipped + i).unwrap_or(&[0.0; TERM_COUNT]);
            let mut inputs = self.inputs(row, terms, shared, local);
            let capacity_j_k = self.housing.capacity_j_k(inputs.outer_k) * shared[LN_CAPACITY].exp();
            let mut along = WallRow::default();
            if self.has_inner_wall {
                let width_s = row_width_s(&rows, i);
                let (next_k, mean_k, found) =
                    self.wall_along(inputs, wall_k, (inner, capacity_j_k, width_s), shared);
                inputs.wall_k = mean_k;
                along = found;
                wall_k = next_k;
            }
            let known = known.and_then(|known| known.states.get(i));
            let near = known.map(|state| (&state.inputs, &state.path));
            let path = self.setting.gas_path_near(near, &inputs, shared);
            let (slopes, compressed) = match derivatives {
                Some(wanted) => {
                    let known = known.and_then(|state| Some((&state.inputs, state.compressed.as_deref()?)));
                    let (slopes, compressed) = self.setting.slopes(&inputs, &path, known, shared, wanted);
                    (slopes, keeps.then(|| Box::new(compressed)))
                }
                None => (Slopes::default(), None),
            };
            let heat_w = self.housing.heat_w(row, inputs.outer_k, shared) + local[STEP_HEAT] + path.duct_w;
            let heat = if derivatives.is_some() {
                self.housing.heat_slopes(row, inputs.outer_k, shared)
            } else {
                Default::default()
            };
            let (outer_j_k, gas_w) = if self.has_inner_wall {
                ((1.0 - inner.0) * capacity_j_k, inner.1 * (inputs.wall_k - inputs.outer_k))
            } else {
                (capacity_j_k, path.wall_w)
            };
            let rate_k_s = (gas_w + heat_w) / outer_j_k;
            let ln_capacity_by_k = self.housing.ln_capacity_by_k(inputs.outer_k);
            states.push(RowState {
                path,
                slopes,
                compressed,
                inputs,
                rate_k_s,
                outer_j_k,
                ln_capacity_by_k,
                heat,
                wall: along,
            });
        }
        let lead = step.lead.len() - skipped.min(step.lead.len());
        let gas_k: Vec<f64> = states[lead..].iter().map(|state| state.path.t2_k).collect();
        let probe = self.probe(&step.rows, &gas_k, shared[PROBE_MM2]);
        let linearised = Linearised { model: self, step, states, lead, inner, probe, gas_k };
        (linearised, start.cloned(), wall_k)
    }

    /// The inner wall that neither warms up nor cools down, K: what a run begins with.
    fn settled_wall_k(&self, inputs: Inputs, (_, conductance_w_k): (f64, f64), shared: &SharedVector) -> f64 {
        let mut wall_k = inputs.outer_k;
        for _ in 0..SETTLED_ROUNDS {
            let inputs = Inputs { wall_k, ..inputs };
            let (wall_w, gas_w_k) = self.setting.wall_heat(&inputs, shared);
            wall_k += (wall_w - conductance_w_k * (wall_k - inputs.outer_k)) / (gas_w_k + conductance_w_k);
        }
        wall_k
    }

    /// The inner wall over a row with constant coefficients: its temperature at the end and its mean, K.
    fn wall_along(
        &self,
        inputs: Inputs,
        start_k: f64,
        ((share, conductance_w_k), capacity_j_k, width_s): ((f64, f64), f64, f64),
        shared: &SharedVector,
    ) -> (f64, f64, WallRow) {
        let inputs = Inputs { wall_k: start_k, ..inputs };
        let (wall_w, gas_w_k) = self.setting.wall_heat(&inputs, shared);
        let sum_w_k = gas_w_k + conductance_w_k;
        let inner_j_k = share * capacity_j_k;
        let settled_k = start_k + (wall_w - conductance_w_k * (start_k - inputs.outer_k)) / sum_w_k;
        let x = width_s * sum_w_k / inner_j_k;
        let (kept, mean) = ((-x).exp(), mean_decay(x));
        let end_k = settled_k + (start_k - settled_k) * kept;
        let stored_w = if width_s > 0.0 { inner_j_k * (end_k - start_k) / width_s } else { 0.0 };
        (end_k, settled_k + (start_k - settled_k) * mean, WallRow { kept, mean, sum_w_k, stored_w })
    }
}

/// Time that a row stands for, s.
fn row_width_s(rows: &[&Row], i: usize) -> f64 {
    let at = |i: usize| rows.get(i).map(|row| row.t_s);
    let before = i.checked_sub(1).and_then(at).zip(at(i)).map(|(a, b)| b - a);
    let after = at(i).zip(at(i + 1)).map(|(a, b)| b - a);
    match (before, after) {
        (Some(before), Some(after)) => 0.5 * (before + after),
        (one, other) => one.or(other).unwrap_or(0.0),
    }
}

/// P1 and P2 without their errors, Pa.
fn pressures_pa(row: &Row, shared: &SharedVector, rest_pa: f64) -> [f64; 2] {
    let corrected = |reading_pa: f64, offset: usize, gain: usize| {
        reading_pa
            - shared[OFFSETS + offset]
            - shared[GAINS + gain] * (reading_pa - rest_pa)
            - shared[BAROMETER]
    };
    [corrected(row.p1_pa, 3, 2), corrected(row.p2_pa, 4, 3)]
}
