//! Predicts the readings of T2 and Tc along a step for given parameters, with their derivatives.
//!
//! T2 follows from eqs. 1-3 and the probe. Tc is its own change: the heat to the housing, integrated over the window and divided by the heat
//! capacity. A housing of one node touches the gas with Tc. One of two nodes touches it with an inner wall of temperature Ti:
//!
//! ```text
//! phi C dTi/dt = q1 + q2 - G (Ti - Tc)      (1 - phi) C dTc/dt = G (Ti - Tc) + q_inlet + Q + w
//! ```
//!
//! Ti is integrated through the whole run, jumps included, with the measured Tc: it remembers the point before. Each parameter acts on a row by
//! a few inputs of the gas path and of the housing; the chain rule gives its column, through wall, probe and integral.

use crate::config::Housing;
use crate::joint::step_model::gas_path::{GasPath, INPUT_COUNT, Input, Inputs, Setting, Slopes};
use crate::joint::step_model::housing::HEAT_PARAMETERS;
use crate::joint::step_model::parameters::{
    ALPHA, BAROMETER, ETA, EXPONENT, FIRST_READING, FLOW_GAIN, GAINS, HUMIDITY, INLET, LN_CAPACITY,
    LN_COEFFICIENT, LN_DEVIATION, LN_HEATING_COOLING_RATIO, LN_INNER_CONDUCTANCE, LOCAL, LOGIT_INNER,
    LocalVector, OFFSETS, P1_GAIN, P1_OFFSET, P2_GAIN, P2_OFFSET, PREHEAT, PROBE_MM2, SHARED, STEP_HEAT,
    SURFACE, SharedVector, T2_GAIN, T2_OFFSET, TC_GAIN, TC_LAG, TC_OFFSET, THERMOMETERS,
};
use crate::joint::step_model::rows::{MAX_ROW_GAP_S, Row, StepRows};
use crate::joint::step_model::surface::{TERM_COUNT, dot};
use crate::single_step::probe::{self, Lag, follow};
use mapper_core::unit_factors::M_PER_MM;
use mapper_physics::rig::sensor_fault::CALIBRATED_AT_K;

/// Step of the derivative by the square of the probe's diameter, relative. Bound: between rounding and curvature.
const PROBE_STEP_RATIO: f64 = 1e-3;
/// Square of the diameter below which the lag is linear in it, mm2: it grows with a power below 1, which has no slope at 0. Bound: 0.3 mm lag
/// by a tenth of a second, below anything that a block of half a second shows.
const LINEAR_BELOW_MM2: f64 = 0.1;
/// Exponent below which the mean over a row replaces the formula. Bound: the next term is below rounding.
const SERIES_BELOW: f64 = 1e-6;

/// The model of all steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Model {
    pub(crate) setting: Setting,
    pub(crate) housing: Housing,
    /// Whether the inner wall has its own temperature.
    pub(crate) has_inner_wall: bool,
    /// Whether the change of Tc is an observation.
    pub(crate) has_balance: bool,
}

/// The data of a step: its rows, and the surface terms at each row minus those at the step's end, first those of the lead.
#[derive(Debug, Clone)]
pub(crate) struct StepHistory<'a> {
    pub(crate) step: &'a StepRows,
    pub(crate) terms: Vec<[f64; TERM_COUNT]>,
}

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

/// One row of the linearised model.
struct RowState {
    path: GasPath,
    slopes: Slopes,
    inputs: Inputs,
    /// Rate of Tc by the heat, K/s.
    rate_k_s: f64,
    /// Heat capacity of the outer part (of the housing, if it is one node), J/K, and the derivative of its logarithm by Tc, 1/K.
    outer_j_k: f64,
    ln_capacity_by_k: f64,
    /// Derivatives of the heat from elsewhere: see [`Housing::heat_slopes`].
    heat: [f64; HEAT_PARAMETERS.len() + 1],
    wall: WallRow,
}

/// The inner wall along a row.
#[derive(Clone, Copy, Default)]
struct WallRow {
    /// Share of its deviation that is left at the row's end.
    kept: f64,
    /// Mean share over the row.
    mean: f64,
    /// Conductance to gas and outer part, W/K.
    sum_w_k: f64,
    /// Its mean rate times its capacity, W.
    stored_w: f64,
}

/// A small change of what acts on a row.
#[derive(Clone, Copy, Default)]
struct Change {
    inputs: [f64; INPUT_COUNT],
    /// Heat from elsewhere, W.
    heat_w: f64,
    /// Tc without its errors, K; also in `inputs`.
    reading_k: f64,
    ln_capacity: f64,
    logit_inner: f64,
    ln_conductance: f64,
}

impl Change {
    fn of(input: Input, by: f64) -> Self {
        let mut change = Change::default();
        change.inputs[input as usize] = by;
        change
    }

    /// Of Tc as read.
    fn of_tc(by: f64) -> Self {
        Change { reading_k: by, ..Change::of(Input::Outer, by) }
    }

    fn heat(by_w: f64) -> Self {
        Change { heat_w: by_w, ..Change::default() }
    }
}

/// A model linearised along a step.
pub(crate) struct Linearised<'a> {
    model: &'a Model,
    step: &'a StepRows,
    states: Vec<RowState>,
    /// Number of states before the window.
    lead: usize,
    /// Capacity share and conductance of the inner wall.
    inner: (f64, f64),
    probe: Probe,
    gas_k: Vec<f64>,
}

/// A probe that lags, or for a negative square of its diameter leads by as much.
struct Probe {
    lags: Vec<Lag>,
    /// Share of the lag, -1 to 1.
    share: f64,
}

impl Probe {
    /// The gas as the probe reads it; `first`: reading at the first row.
    fn read(&self, gas_k: &[f64], first: f64) -> Vec<f64> {
        if self.share == 0.0 {
            return gas_k.to_vec();
        }
        let lagged = follow(&self.lags, first, gas_k);
        lagged.iter().zip(gas_k).map(|(lagged, gas)| gas + self.share * (lagged - gas)).collect()
    }
}

/// Share of the heat capacity in the inner wall, and its conductance, W/K.
pub(crate) fn inner_wall(shared: &SharedVector) -> (f64, f64) {
    (1.0 / (1.0 + (-shared[LOGIT_INNER]).exp()), shared[LN_INNER_CONDUCTANCE].exp())
}

/// Tc without its errors, K.
fn outer_k(row: &Row, shared: &SharedVector) -> f64 {
    row.tc_k + shared[TC_LAG] * row.tc_slope_k_s - tc_error_k(row.tc_k, shared)
}

fn tc_error_k(read_k: f64, shared: &SharedVector) -> f64 {
    shared[OFFSETS + 2] + shared[THERMOMETERS] + shared[GAINS + 1] * (read_k - CALIBRATED_AT_K)
}

fn t2_error_k(read_k: f64, shared: &SharedVector) -> f64 {
    shared[OFFSETS + 1] + shared[THERMOMETERS] + shared[GAINS] * (read_k - CALIBRATED_AT_K)
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
        let outer_k = outer_k(row, shared);
        let [p1_pa, p2_pa] = pressures_pa(row, shared, self.setting.rest_pressure_pa);
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
            let with_model = active[INLET] || active[HUMIDITY];
            self.linearised(history, shared, local, derivatives.then_some(with_model), before)
        };
        let mut readings_k = linearised.probe.read(&linearised.gas_k, local[FIRST_READING]);
        let t2_reads = readings_k.iter_mut().zip(&history.step.rows);
        t2_reads.for_each(|(reading, row)| *reading += t2_error_k(row.t2_k, shared));
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

    /// The states along a step, the wall it starts from, and the wall at its end, K. `derivatives`: see [`Setting::slopes`].
    pub(crate) fn linearised<'a>(
        &'a self,
        history: &StepHistory<'a>,
        shared: &SharedVector,
        local: &LocalVector,
        derivatives: Option<bool>,
        before: Option<&Wall>,
    ) -> (Linearised<'a>, Option<Wall>, f64) {
        let step = history.step;
        let skipped = if self.has_inner_wall { 0 } else { step.lead.len() };
        let rows: Vec<&Row> = step.lead.iter().chain(&step.rows).skip(skipped).collect();
        let inner = inner_wall(shared);
        let start = before.filter(|wall| rows.first().is_some_and(|row| row.t_s - wall.t_s < MAX_ROW_GAP_S));
        let mut wall_k =
            start.map_or_else(|| rows.first().map_or(f64::NAN, |row| outer_k(row, shared)), |w| w.wall_k);
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
            let path = self.setting.gas_path(&inputs, shared);
            let slopes = match derivatives {
                Some(with_model) => self.setting.slopes(&inputs, &path, shared, with_model),
                None => Slopes::default(),
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

    /// The inner wall over a row with constant coefficients: its temperature at the end and its mean, K.
    fn wall_along(
        &self,
        inputs: Inputs,
        start_k: f64,
        ((share, conductance_w_k), capacity_j_k, width_s): ((f64, f64), f64, f64),
        shared: &SharedVector,
    ) -> (f64, f64, WallRow) {
        let inputs = Inputs { wall_k: start_k, ..inputs };
        let wall_w = self.setting.gas_path(&inputs, shared).wall_w;
        let gas_w_k = self.setting.wall_conductance_w_k(&inputs, wall_w, shared);
        let sum_w_k = gas_w_k + conductance_w_k;
        let inner_j_k = share * capacity_j_k;
        let settled_k = start_k + (wall_w - conductance_w_k * (start_k - inputs.outer_k)) / sum_w_k;
        let x = width_s * sum_w_k / inner_j_k;
        let (kept, mean) = ((-x).exp(), mean_decay(x));
        let end_k = settled_k + (start_k - settled_k) * kept;
        let stored_w = if width_s > 0.0 { inner_j_k * (end_k - start_k) / width_s } else { 0.0 };
        (end_k, settled_k + (start_k - settled_k) * mean, WallRow { kept, mean, sum_w_k, stored_w })
    }

    /// The probe along the rows, for the square of its diameter.
    fn probe(&self, rows: &[Row], gas_k: &[f64], square_mm2: f64) -> Probe {
        let share = (square_mm2 / LINEAR_BELOW_MM2).clamp(-1.0, 1.0);
        let diameter_m = M_PER_MM * square_mm2.abs().max(LINEAR_BELOW_MM2).sqrt();
        let rows = rows.iter().zip(gas_k).map(|(row, gas_k)| (row.t_s, row.flow_kg_s, *gas_k));
        Probe { lags: probe::lags(rows, diameter_m, self.setting.outlet_diameter_m), share }
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

impl Linearised<'_> {
    /// Tc by its heat from the first row of the window on, with the errors of its reading, K.
    fn tc_k(&self, shared: &SharedVector) -> Vec<f64> {
        let rows = &self.step.rows;
        let start_k = rows.first().map_or(0.0, |row| row.tc_k);
        let rates: Vec<f64> = self.states[self.lead..].iter().map(|state| state.rate_k_s).collect();
        let integral = integral(rows, &rates);
        integral
            .into_iter()
            .zip(rows)
            .map(|(change_k, row)| {
                start_k + change_k + tc_error_k(row.tc_k, shared) - shared[TC_LAG] * row.tc_slope_k_s
            })
            .collect()
    }

    /// Changes of the readings, and of the inner wall at the end, by a change of each row.
    fn respond(&self, change: impl Fn(usize, &RowState) -> Change, start_k: Option<f64>) -> (Vec<f64>, f64) {
        // Without a step before, the wall starts at Tc.
        let of_first =
            || self.states.first().map_or(0.0, |state| change(0, state).inputs[Input::Outer as usize]);
        let mut wall_k = start_k.unwrap_or_else(of_first);
        let window = self.states.len() - self.lead;
        let (mut gas, mut rates, mut readings) =
            (Vec::with_capacity(window), Vec::with_capacity(window), Vec::with_capacity(window));
        let (share, conductance_w_k) = self.inner;
        for (i, state) in self.states.iter().enumerate() {
            let Change { inputs, heat_w, reading_k, ln_capacity, logit_inner, ln_conductance } =
                change(i, state);
            let outer_k = inputs[Input::Outer as usize];
            let by = |which: usize| (0..INPUT_COUNT).map(|k| state.slopes[k][which] * inputs[k]).sum::<f64>();
            let (mut t2_k, mut wall_w, duct_w) = (by(0), by(1), by(2));
            let mut row_wall_k = outer_k;
            if self.model.has_inner_wall {
                let off_k = state.inputs.wall_k - state.inputs.outer_k;
                let driving_w = wall_w + conductance_w_k * (outer_k - ln_conductance * off_k)
                    - (ln_capacity + (1.0 - share) * logit_inner) * state.wall.stored_w;
                let settled_k = driving_w / state.wall.sum_w_k;
                row_wall_k = settled_k + (wall_k - settled_k) * state.wall.mean;
                wall_k = settled_k + (wall_k - settled_k) * state.wall.kept;
            }
            t2_k += state.slopes[Input::Wall as usize][0] * row_wall_k;
            wall_w += state.slopes[Input::Wall as usize][1] * row_wall_k;
            if i < self.lead {
                continue;
            }
            gas.push(t2_k);
            if self.model.has_balance {
                let added_w = heat_w + duct_w + state.heat[HEAT_PARAMETERS.len()] * outer_k;
                let (gas_w, ln_outer) = if self.model.has_inner_wall {
                    let off_k = state.inputs.wall_k - state.inputs.outer_k;
                    let through_w = conductance_w_k * (row_wall_k - outer_k + ln_conductance * off_k);
                    (through_w, ln_capacity - share * logit_inner)
                } else {
                    (wall_w, ln_capacity)
                };
                let ln_outer = ln_outer + state.ln_capacity_by_k * outer_k;
                rates.push((gas_w + added_w) / state.outer_j_k - state.rate_k_s * ln_outer);
                readings.push(reading_k);
            }
        }
        let mut column = self.probe.read(&gas, 0.0);
        if self.model.has_balance {
            let changes = integral(&self.step.rows, &rates);
            column.extend(changes.into_iter().zip(readings).map(|(change, reading)| change - reading));
        }
        (column, wall_k)
    }

    /// Change of the readings by a function along the window of a channel of [`Smoothing`](super::smoothing::Smoothing).
    pub(crate) fn by_input(
        &self,
        input: SmoothedInput,
        values: &[f64],
        slopes: &[f64],
        lag_s: f64,
    ) -> Vec<f64> {
        let at = |i: usize| i.checked_sub(self.lead).map(|row| (values[row], slopes[row]));
        let change = |i: usize, state: &RowState| {
            let Some((value, slope)) = at(i) else { return Change::default() };
            match input {
                SmoothedInput::T1 => Change::of(Input::T1, value),
                // The row of its own reading is not smoothed: only the correction for the lag is.
                SmoothedInput::Tc => {
                    Change { reading_k: lag_s * slope, ..Change::of(Input::Outer, value + lag_s * slope) }
                }
                SmoothedInput::P1 => Change::of(Input::LnPressureRatio, -value / state.inputs.p1_pa),
                SmoothedInput::P2 => Change::of(Input::LnPressureRatio, value / state.inputs.p2_pa),
                SmoothedInput::Flow => Change::of(Input::Flow, value),
            }
        };
        self.respond(change, Some(0.0)).0
    }

    /// Change of the readings by an efficiency that is wrong by the surface's own slope.
    pub(crate) fn by_surface(&self, history: &StepHistory<'_>, shared: &SharedVector) -> Vec<f64> {
        let skipped = history.terms.len() - self.states.len();
        let surface = surface_of(shared);
        self.respond(|i, _| Change::of(Input::Eta, dot(&history.terms[skipped + i], surface)), Some(0.0)).0
    }

    fn by_local(&self, index: usize) -> Vec<f64> {
        match index {
            ETA => self.respond(|_, _| Change::of(Input::Eta, 1.0), Some(0.0)).0,
            LN_DEVIATION => self.respond(|_, _| Change::of(Input::LnH, 1.0), Some(0.0)).0,
            STEP_HEAT => self.respond(|_, _| Change::heat(1.0), Some(0.0)).0,
            _ => self.of_t2(&self.probe.read(&vec![0.0; self.gas_k.len()], 1.0)),
        }
    }

    /// The column of a shared parameter, and the change of the inner wall at the end. `start_k`: that at the start.
    fn by_shared(
        &self,
        index: usize,
        history: &StepHistory<'_>,
        shared: &SharedVector,
        local: &LocalVector,
        start_k: Option<f64>,
    ) -> (Vec<f64>, f64) {
        let rows: Vec<&Row> = self
            .step
            .lead
            .iter()
            .chain(&self.step.rows)
            .skip(history.terms.len() - self.states.len())
            .collect();
        let rest_pa = self.model.setting.rest_pressure_pa;
        let by = |change: &dyn Fn(&RowState, &Row, usize) -> Change| {
            self.respond(|i, state| change(state, rows[i], i), start_k)
        };
        let input = |input: Input, of: &dyn Fn(&RowState, &Row) -> f64| {
            by(&|state, row, _| Change::of(input, of(state, row)))
        };
        let with_t2 = |(mut column, end_k): (Vec<f64>, f64), of: &dyn Fn(&Row) -> f64| {
            column.iter_mut().zip(&self.step.rows).for_each(|(value, row)| *value += of(row));
            (column, end_k)
        };
        let nothing = || (self.of_t2(&vec![0.0; self.gas_k.len()]), 0.0);
        if let Some(place) = HEAT_PARAMETERS.iter().position(|parameter| *parameter == index) {
            return by(&|state, _, _| Change::heat(state.heat[place]));
        }
        let skipped = history.terms.len() - self.states.len();
        match index {
            LN_COEFFICIENT => input(Input::LnH, &|_, _| 1.0),
            EXPONENT => {
                input(Input::LnH, &|state, _| self.model.setting.ln_reynolds(&state.inputs, &state.path))
            }
            ALPHA => input(Input::Alpha, &|_, _| 1.0),
            LN_HEATING_COOLING_RATIO => input(Input::LnRatio, &|_, _| 1.0),
            PREHEAT => input(Input::Preheat, &|_, _| 1.0),
            INLET => input(Input::Inlet, &|_, _| 1.0),
            HUMIDITY => input(Input::Humidity, &|_, _| 1.0),
            OFFSETS => input(Input::T1, &|_, _| -1.0),
            T2_OFFSET => with_t2(nothing(), &|_| 1.0),
            TC_OFFSET => by(&|_, _, _| Change::of_tc(-1.0)),
            P1_OFFSET => input(Input::LnPressureRatio, &|state, _| 1.0 / state.inputs.p1_pa),
            P2_OFFSET => input(Input::LnPressureRatio, &|state, _| -1.0 / state.inputs.p2_pa),
            FLOW_GAIN => input(Input::Flow, &|state, _| -state.inputs.flow_kg_s / (1.0 + shared[FLOW_GAIN])),
            T2_GAIN => with_t2(nothing(), &|row| row.t2_k - CALIBRATED_AT_K),
            TC_GAIN => by(&|_, row, _| Change::of_tc(CALIBRATED_AT_K - row.tc_k)),
            P1_GAIN => {
                input(Input::LnPressureRatio, &|state, row| (row.p1_pa - rest_pa) / state.inputs.p1_pa)
            }
            P2_GAIN => {
                input(Input::LnPressureRatio, &|state, row| (rest_pa - row.p2_pa) / state.inputs.p2_pa)
            }
            BAROMETER => input(Input::LnPressureRatio, &|state, _| {
                state.inputs.p1_pa.recip() - state.inputs.p2_pa.recip()
            }),
            THERMOMETERS => with_t2(
                by(&|_, _, _| {
                    let mut change = Change::of_tc(-1.0);
                    change.inputs[Input::T1 as usize] = -1.0;
                    change
                }),
                &|_| 1.0,
            ),
            TC_LAG => by(&|_, row, _| Change::of_tc(row.tc_slope_k_s)),
            LN_CAPACITY => by(&|_, _, _| Change { ln_capacity: 1.0, ..Change::default() }),
            LOGIT_INNER => by(&|_, _, _| Change { logit_inner: 1.0, ..Change::default() }),
            LN_INNER_CONDUCTANCE => by(&|_, _, _| Change { ln_conductance: 1.0, ..Change::default() }),
            PROBE_MM2 => (self.by_probe(shared, local), 0.0),
            SURFACE.. => by(&|_, _, i| {
                Change::of(
                    Input::Eta,
                    history.terms.get(skipped + i).map_or(0.0, |terms| terms[index - SURFACE]),
                )
            }),
            _ => nothing(),
        }
    }

    /// The column of the probe, by a central difference.
    fn by_probe(&self, shared: &SharedVector, local: &LocalVector) -> Vec<f64> {
        let square_mm2 = shared[PROBE_MM2];
        let step = PROBE_STEP_RATIO * square_mm2.abs().max(LINEAR_BELOW_MM2);
        let readings = |square_mm2: f64| {
            let probe = self.model.probe(&self.step.rows, &self.gas_k, square_mm2);
            probe.read(&self.gas_k, local[FIRST_READING])
        };
        let (low, high) = (readings(square_mm2 - step), readings(square_mm2 + step));
        let slope: Vec<f64> = high.iter().zip(&low).map(|(high, low)| (high - low) / (2.0 * step)).collect();
        self.of_t2(&slope)
    }

    /// A column that only T2 has.
    fn of_t2(&self, t2: &[f64]) -> Vec<f64> {
        let rows = if self.model.has_balance { 2 * t2.len() } else { t2.len() };
        let mut column = t2.to_vec();
        column.resize(rows, 0.0);
        column
    }
}

/// A smoothed input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SmoothedInput {
    T1,
    Tc,
    P1,
    P2,
    Flow,
}

/// Integral of rates over the rows of a window by the trapezoidal rule, from 0 at the first.
fn integral(rows: &[Row], rates: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut sums = Vec::with_capacity(rows.len());
    for i in 0..rows.len() {
        if i > 0 {
            sum += 0.5 * (rates[i] + rates[i - 1]) * (rows[i].t_s - rows[i - 1].t_s);
        }
        sums.push(sum);
    }
    sums
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

/// The surface coefficients among the shared parameters.
pub(crate) fn surface_of(shared: &SharedVector) -> &[f64; TERM_COUNT] {
    shared.get(SURFACE..).and_then(|tail| tail.try_into().ok()).unwrap_or(&[0.0; TERM_COUNT])
}

#[cfg(test)]
#[path = "history_tests.rs"]
mod tests;
