//! A step's model linearised: one column per parameter, by the chain rule from the inputs of a row through wall, probe and integral.

use crate::config::Housing;
use crate::joint::step_model::gas_path::{
    Compressed, GasPath, HEAT_PARAMETERS, HeatSlopes, Input, Inputs, Setting, Slopes,
};
use crate::joint::step_model::parameters::{
    ALPHA, BAROMETER, ETA, EXPONENT, FIRST_READING, FLOW_GAIN, GAINS, HUMIDITY, INLET, LN_CAPACITY,
    LN_COEFFICIENT, LN_DEVIATION, LN_HEATING_COOLING_RATIO, LocalVector, OFFSETS, P1_GAIN, P1_OFFSET,
    P2_GAIN, P2_OFFSET, PREHEAT, PROBE_MM2, STEP_HEAT, SURFACE, SharedVector, T2_GAIN, T2_OFFSET, TC_GAIN,
    TC_LAG, TC_OFFSET, TERM_COUNT, THERMOMETERS, dot,
};
use crate::joint::step_model::parts::{Division, OTHERS, Parts, PartsRow, SETTLED_ROUNDS};
use crate::joint::step_model::rows::{Row, StepRows};
use crate::single_step::fit::{self, Lag, follow};
use mapper_core::unit_factors::M_PER_MM;
use mapper_physics::rig::sensor_fault::ExactReadings;

/// Step of the derivative by the square of the probe's diameter, relative. Bound: between rounding and curvature.
const PROBE_STEP_RATIO: f64 = 1e-3;
/// Square of the diameter below which the lag is linear in it, mm2: it grows with a power below 1, which has no slope at 0. Bound: 0.3 mm lag
/// by a tenth of a second, below anything that a block of half a second shows.
pub(crate) const LINEAR_BELOW_MM2: f64 = 0.1;

/// The model of all steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Model {
    pub(crate) setting: Setting,
    pub(crate) housing: Housing,
    /// The parts of the housing that have their own temperature.
    pub(crate) parts: Parts,
    /// Whether the change of Tc is an observation.
    pub(crate) has_balance: bool,
}

/// The data of a step: its rows, and at each of them, first those of the lead, the surface terms minus those at the step's end, and their slope
/// by the flow, 1/(kg/s).
#[derive(Debug, Clone)]
pub(crate) struct StepHistory<'a> {
    pub(crate) step: &'a StepRows,
    pub(crate) terms: Vec<[f64; TERM_COUNT]>,
    pub(crate) by_flow: Vec<[f64; TERM_COUNT]>,
}

/// One row of the linearised model.
pub(super) struct RowState {
    pub(super) path: GasPath,
    pub(super) slopes: Slopes,
    pub(super) compressed: Option<Box<Compressed>>,
    pub(super) inputs: Inputs,
    /// Rate of Tc by the heat, K/s.
    pub(super) rate_k_s: f64,
    /// Heat capacity of the outer part, J/K, and the derivative of its logarithm by Tc, 1/K.
    pub(super) outer_j_k: f64,
    pub(super) ln_capacity_by_k: f64,
    /// Heat from bearing and turbine, W.
    pub(super) bearing_w: f64,
    /// Derivatives of the heat from elsewhere.
    pub(super) heat: HeatSlopes,
    /// Conductance between gas and wall, W/K.
    pub(super) contact_w_k: f64,
    pub(super) parts: PartsRow,
}

/// Maximum number of inputs that a change moves. Source: [`Change`]'s constructors.
const MOVED_INPUTS: usize = 2;

/// A small change of what acts on a row.
#[derive(Clone, Copy)]
pub(super) struct Change {
    /// Inputs of the gas path and by how much each changes.
    inputs: [(Input, f64); MOVED_INPUTS],
    /// Heat from elsewhere, W: from bearing and turbine, and the rest.
    heats_w: [f64; 2],
    /// Tc without its errors, K; also in `inputs`.
    reading_k: f64,
    ln_capacity: f64,
    division: Option<Division>,
}

impl Default for Change {
    fn default() -> Self {
        Change {
            inputs: [(Input::Eta, 0.0); MOVED_INPUTS],
            heats_w: [0.0; 2],
            reading_k: 0.0,
            ln_capacity: 0.0,
            division: None,
        }
    }
}

impl Change {
    fn outer_k(&self) -> f64 {
        self.inputs.iter().filter(|(input, _)| *input == Input::Outer).map(|(_, by)| by).sum()
    }

    fn of(input: Input, by: f64) -> Self {
        Change { inputs: [(input, by), (input, 0.0)], ..Change::default() }
    }

    /// With a change of another input.
    fn and(mut self, input: Input, by: f64) -> Self {
        self.inputs[1] = (input, by);
        self
    }

    /// Of Tc as read.
    fn of_tc(by: f64) -> Self {
        Change { reading_k: by, ..Change::of(Input::Outer, by) }
    }

    fn heats(by_w: [f64; 2]) -> Self {
        Change { heats_w: by_w, ..Change::default() }
    }
}

/// A change as it acts in a row.
struct OwnChange {
    outer_k: f64,
    /// Of T2, heat to the wall, heat of the inlet and conductance, with the wall as it is.
    by: [f64; 4],
    division: Division,
    bearing_w: f64,
}

/// A model linearised along a step.
pub(crate) struct Linearised<'a> {
    pub(super) model: &'a Model,
    pub(super) step: &'a StepRows,
    pub(super) states: Vec<RowState>,
    /// Number of states before the window.
    pub(super) lead: usize,
    pub(super) division: Division,
    pub(super) probe: Probe,
    pub(super) gas_k: Vec<f64>,
}

/// A probe that lags, or for a negative square of its diameter leads by as much.
pub(super) struct Probe {
    pub(super) lags: Vec<Lag>,
    /// Share of the lag, -1 to 1.
    pub(super) share: f64,
}

impl Probe {
    /// The gas as the probe reads it. `first`: the first reading, a parameter for every lag, 0 included: if only a lag had it, a fit would find a lag
    /// because of the row that it explains.
    pub(super) fn read(&self, gas_k: &[f64], first: f64) -> Vec<f64> {
        let lagged = follow(&self.lags, first, gas_k);
        let mut read: Vec<f64> =
            lagged.iter().zip(gas_k).map(|(lagged, gas)| gas + self.share * (lagged - gas)).collect();
        if let Some(reading) = read.first_mut() {
            *reading = first;
        }
        read
    }
}

impl Model {
    /// The probe along the rows, for the square of its diameter.
    pub(super) fn probe(&self, rows: &[Row], gas_k: &[f64], square_mm2: f64) -> Probe {
        let share = (square_mm2 / LINEAR_BELOW_MM2).clamp(-1.0, 1.0);
        let diameter_m = M_PER_MM * square_mm2.abs().max(LINEAR_BELOW_MM2).sqrt();
        let rows = rows.iter().zip(gas_k).map(|(row, gas_k)| (row.t_s, row.flow_kg_s, *gas_k));
        Probe { lags: fit::lags(rows, diameter_m, self.setting.outlet_diameter_m), share }
    }
}

impl Linearised<'_> {
    /// Tc by its heat from the first row of the window on, with the errors of its reading, K.
    pub(super) fn tc_k(&self, shared: &SharedVector) -> Vec<f64> {
        let rows = &self.step.rows;
        let start_k = rows.first().map_or(0.0, |row| row.tc_k);
        let rates: Vec<f64> = self.states[self.lead..].iter().map(|state| state.rate_k_s).collect();
        let integral = integral(rows, &rates);
        integral
            .into_iter()
            .zip(rows)
            .map(|(change_k, row)| {
                start_k + change_k + tc_error_k(row.tc_k, shared, self.model.setting.exact_at)
                    - shared[TC_LAG] * row.tc_slope_k_s
            })
            .collect()
    }

    /// Changes of the readings, and of the other parts of the housing at the end, by a change of each row.
    fn respond(
        &self,
        change: impl Fn(usize, &RowState) -> Change,
        start_k: Option<[f64; OTHERS]>,
    ) -> (Vec<f64>, [f64; OTHERS]) {
        let mut parts_k = start_k;
        let window = self.states.len() - self.lead;
        let (mut gas, mut rates, mut readings) =
            (Vec::with_capacity(window), Vec::with_capacity(window), Vec::with_capacity(window));
        for (i, state) in self.states.iter().enumerate() {
            let change = change(i, state);
            let by = |which: usize| -> f64 {
                change.inputs.iter().map(|(input, by)| state.slopes[*input as usize][which] * by).sum()
            };
            let own = OwnChange {
                outer_k: change.outer_k(),
                by: [by(0), by(1), by(2), by(3)],
                division: change.division.unwrap_or_default(),
                bearing_w: change.heats_w[0] + state.heat[HEAT_PARAMETERS.len()][0] * change.outer_k(),
            };
            let mean_k = if self.division.others > 0 {
                let (mean_k, end_k) = self.parts_change(state, &own, change.ln_capacity, parts_k);
                parts_k = Some(end_k);
                mean_k
            } else {
                [0.0; OTHERS]
            };
            let wall_k = self.division.wall_k(own.outer_k, &mean_k)
                + own.division.wall_k(state.inputs.outer_k, &state.parts.mean_k);
            if i < self.lead {
                continue;
            }
            let total = |which: usize| own.by[which] + state.slopes[Input::Wall as usize][which] * wall_k;
            gas.push(total(0));
            if self.model.has_balance {
                let from_gas_w = self.gas_heat_w(state, 0, own.outer_k, (wall_k, total(1), total(3)), &own);
                let rest_w = change.heats_w[1] + state.heat[HEAT_PARAMETERS.len()][1] * own.outer_k;
                let mut outer_w = from_gas_w + own.bearing_w + rest_w + own.by[2];
                for (part, part_k) in mean_k.into_iter().enumerate().take(self.division.others) {
                    let off_k = state.parts.mean_k[part] - state.inputs.outer_k;
                    outer_w += self.division.conductance_w_k[part] * (part_k - own.outer_k)
                        + own.division.conductance_w_k[part] * off_k
                        - self.division.bearing[part] * own.bearing_w
                        - own.division.bearing[part] * state.bearing_w;
                }
                let ln_outer = change.ln_capacity
                    + own.division.capacity[0] / self.division.capacity[0]
                    + state.ln_capacity_by_k * own.outer_k;
                rates.push(outer_w / state.outer_j_k - state.rate_k_s * ln_outer);
                readings.push(change.reading_k);
            }
        }
        let mut column = self.probe.read(&gas, 0.0);
        if self.model.has_balance {
            let changes = integral(&self.step.rows, &rates);
            column.extend(changes.into_iter().zip(readings).map(|(change, reading)| change - reading));
        }
        (column, parts_k.unwrap_or_default())
    }

    /// Change of the heat from the gas to a part (0: the outer one) that changes by `part_k`, W; `(wall_k, wall_w, contact_w_k)`: changes of
    /// the mean wall, of the heat to it, and of the conductance.
    fn gas_heat_w(
        &self,
        state: &RowState,
        part: usize,
        part_k: f64,
        (wall_k, wall_w, contact_w_k): (f64, f64, f64),
        own: &OwnChange,
    ) -> f64 {
        let at_k = part.checked_sub(1).map_or(state.inputs.outer_k, |other| state.parts.mean_k[other]);
        let off_k = state.inputs.wall_k - at_k;
        self.division.area[part] * (wall_w + contact_w_k * off_k + state.contact_w_k * (wall_k - part_k))
            + own.division.area[part] * (state.path.wall_w + state.contact_w_k * off_k)
    }

    /// Mean change of each other part over a row, and that at its end. `from_k`: the changes at its begin; without a step before, the parts are
    /// settled.
    fn parts_change(
        &self,
        state: &RowState,
        own: &OwnChange,
        ln_capacity: f64,
        from_k: Option<[f64; OTHERS]>,
    ) -> ([f64; OTHERS], [f64; OTHERS]) {
        let Division { others, area, conductance_w_k, capacity, bearing } = self.division;
        let by_wall = state.slopes[Input::Wall as usize];
        let settled_k = |part: usize, around_k: &[f64; OTHERS]| {
            // The part's own temperature acts through `sum_w_k`.
            let wall_k = self.division.wall_k(own.outer_k, around_k) - area[part + 1] * around_k[part]
                + own.division.wall_k(state.inputs.outer_k, &state.parts.mean_k);
            let wall = (wall_k, own.by[1] + by_wall[1] * wall_k, own.by[3] + by_wall[3] * wall_k);
            let off_k = state.parts.mean_k[part] - state.inputs.outer_k;
            let ln_capacity = ln_capacity + own.division.capacity[part + 1] / capacity[part + 1];
            let driving_w = self.gas_heat_w(state, part + 1, 0.0, wall, own)
                + conductance_w_k[part] * own.outer_k
                - own.division.conductance_w_k[part] * off_k
                + bearing[part] * own.bearing_w
                + own.division.bearing[part] * state.bearing_w
                - ln_capacity * state.parts.stored_w[part];
            driving_w / state.parts.sum_w_k[part]
        };
        let from_k = from_k.unwrap_or_else(|| {
            let mut around_k = [0.0; OTHERS];
            for _ in 0..SETTLED_ROUNDS {
                for part in 0..others {
                    around_k[part] = settled_k(part, &around_k);
                }
            }
            around_k
        });
        let (mut mean_k, mut end_k) = ([0.0; OTHERS], [0.0; OTHERS]);
        for part in 0..others {
            let settled_k = settled_k(part, &from_k);
            let away_k = from_k[part] - settled_k;
            mean_k[part] = settled_k + away_k * state.parts.mean[part];
            end_k[part] = settled_k + away_k * state.parts.kept[part];
        }
        (mean_k, end_k)
    }

    /// Change of the readings by a function along the window of a channel of [`Smoothing`](crate::joint::step_model::rows::Smoothing).
    pub(crate) fn by_input(
        &self,
        history: &StepHistory<'_>,
        input: SmoothedInput,
        values: &[f64],
        slopes: &[f64],
        shared: &SharedVector,
    ) -> Vec<f64> {
        let (lag_s, gain_ratio) = (shared[TC_LAG], shared[TC_GAIN]);
        let at = |i: usize| i.checked_sub(self.lead).map(|row| (values[row], slopes[row]));
        let skipped = history.terms.len() - self.states.len();
        let eta_by_flow = |i: usize| dot(&history.by_flow[skipped + i], surface_of(shared));
        let change = |i: usize, state: &RowState| {
            let Some((value, slope)) = at(i) else { return Change::default() };
            match input {
                SmoothedInput::T1 => Change::of(Input::T1, value),
                // The row of its own reading is not smoothed: only the corrections for lag and gain are.
                SmoothedInput::Tc => {
                    let reading_k = lag_s * slope - gain_ratio * value;
                    Change { reading_k, ..Change::of(Input::Outer, value + reading_k) }
                }
                SmoothedInput::P1 => Change::of(Input::LnPressureRatio, -value / state.inputs.p1_pa),
                SmoothedInput::P2 => Change::of(Input::LnPressureRatio, value / state.inputs.p2_pa),
                // The flow is also the place on the map.
                SmoothedInput::Flow => Change::of(Input::Flow, value).and(Input::Eta, eta_by_flow(i) * value),
            }
        };
        self.respond(change, Some([0.0; OTHERS])).0
    }

    /// Change of the readings by an efficiency that is wrong by the surface's own slope.
    pub(crate) fn by_surface(&self, history: &StepHistory<'_>, shared: &SharedVector) -> Vec<f64> {
        let skipped = history.terms.len() - self.states.len();
        let surface = surface_of(shared);
        self.respond(
            |i, _| Change::of(Input::Eta, dot(&history.terms[skipped + i], surface)),
            Some([0.0; OTHERS]),
        )
        .0
    }

    pub(crate) fn by_local(&self, index: usize) -> Vec<f64> {
        match index {
            ETA => self.respond(|_, _| Change::of(Input::Eta, 1.0), Some([0.0; OTHERS])).0,
            LN_DEVIATION => self.respond(|_, _| Change::of(Input::LnH, 1.0), Some([0.0; OTHERS])).0,
            STEP_HEAT => self.respond(|_, _| Change::heats([0.0, 1.0]), Some([0.0; OTHERS])).0,
            _ => self.of_t2(&self.probe.read(&vec![0.0; self.gas_k.len()], 1.0)),
        }
    }

    /// The column of a shared parameter, and the change of the other parts of the housing at the end. `start_k`: that at the start.
    pub(super) fn by_shared(
        &self,
        index: usize,
        history: &StepHistory<'_>,
        shared: &SharedVector,
        local: &LocalVector,
        start_k: Option<[f64; OTHERS]>,
    ) -> (Vec<f64>, [f64; OTHERS]) {
        let rows: Vec<&Row> = self
            .step
            .lead
            .iter()
            .chain(&self.step.rows)
            .skip(history.terms.len() - self.states.len())
            .collect();
        let ExactReadings { pressure_pa: rest_pa, temperature_k: rest_k } = self.model.setting.exact_at;
        let by = |change: &dyn Fn(&RowState, &Row, usize) -> Change| {
            self.respond(|i, state| change(state, rows[i], i), start_k)
        };
        let input = |input: Input, of: &dyn Fn(&RowState, &Row) -> f64| {
            by(&|state, row, _| Change::of(input, of(state, row)))
        };
        let with_t2 = |(mut column, end_k): (Vec<f64>, [f64; OTHERS])| {
            column.iter_mut().take(self.step.rows.len()).for_each(|value| *value += 1.0);
            (column, end_k)
        };
        let nothing = || (self.of_t2(&vec![0.0; self.gas_k.len()]), [0.0; OTHERS]);
        if let Some(place) = HEAT_PARAMETERS.iter().position(|parameter| *parameter == index) {
            return by(&|state, _, _| Change::heats(state.heat[place]));
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
            T2_OFFSET => with_t2(nothing()),
            TC_OFFSET => by(&|_, _, _| Change::of_tc(-1.0)),
            P1_OFFSET => input(Input::LnPressureRatio, &|state, _| 1.0 / state.inputs.p1_pa),
            P2_OFFSET => input(Input::LnPressureRatio, &|state, _| -1.0 / state.inputs.p2_pa),
            FLOW_GAIN => input(Input::Flow, &|state, _| -state.inputs.flow_kg_s / (1.0 + shared[FLOW_GAIN])),
            T2_GAIN => {
                let probe_k = self.probe.read(&self.gas_k, local[FIRST_READING]);
                let distances: Vec<f64> = probe_k.iter().map(|probe_k| probe_k - rest_k).collect();
                (self.of_t2(&distances), [0.0; OTHERS])
            }
            TC_GAIN => by(&|_, row, _| Change::of_tc(rest_k - row.tc_k)),
            P1_GAIN => {
                input(Input::LnPressureRatio, &|state, row| (row.p1_pa - rest_pa) / state.inputs.p1_pa)
            }
            P2_GAIN => {
                input(Input::LnPressureRatio, &|state, row| (rest_pa - row.p2_pa) / state.inputs.p2_pa)
            }
            BAROMETER => input(Input::LnPressureRatio, &|state, _| {
                state.inputs.p1_pa.recip() - state.inputs.p2_pa.recip()
            }),
            THERMOMETERS => with_t2(by(&|_, _, _| Change::of_tc(-1.0).and(Input::T1, -1.0))),
            TC_LAG => by(&|_, row, _| Change::of_tc(row.tc_slope_k_s)),
            LN_CAPACITY => by(&|_, _, _| Change { ln_capacity: 1.0, ..Change::default() }),
            _ if self.model.parts.parameters().contains(&index) => {
                let division = Some(Division::slope(self.model.parts, shared, index));
                by(&|_, _, _| Change { division, ..Change::default() })
            }
            PROBE_MM2 => (self.by_probe(shared, local), [0.0; OTHERS]),
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

pub(super) fn tc_error_k(read_k: f64, shared: &SharedVector, exact_at: ExactReadings) -> f64 {
    shared[OFFSETS + 2] + shared[THERMOMETERS] + shared[GAINS + 1] * (read_k - exact_at.temperature_k)
}

/// The surface coefficients among the shared parameters.
pub(crate) fn surface_of(shared: &SharedVector) -> &[f64; TERM_COUNT] {
    shared.get(SURFACE..).and_then(|tail| tail.try_into().ok()).unwrap_or(&[0.0; TERM_COUNT])
}

#[cfg(test)]
mod tests {
    //! The columns of the model against differences of its predictions.

    use super::*;
    use crate::IdentifyConfig;
    use crate::joint::step_model::parameters::{
        LN_INNER_CONDUCTANCE, LN_THIRD_CONDUCTANCE, LOCAL, LOGIT_AREA, LOGIT_BEARING, LOGIT_INNER,
        LOGIT_THIRD, LOGIT_THIRD_AREA, SHARED,
    };
    use crate::joint::step_model::rows::Smoothing;
    use nalgebra::DMatrix;

    fn model(parts: Parts) -> Model {
        let config = IdentifyConfig::default();
        let exact_at = ExactReadings { pressure_pa: 100e3, temperature_k: 297.0 };
        let setting = Setting { exact_at, ..Setting::of(&config, 1.3e5) };
        Model { setting, housing: config.housing, parts, has_balance: true }
    }

    /// A step after a jump: the housing warms up, flow and P2 settle.
    fn step() -> StepRows {
        let row = |i: i32| {
            let t_s = 0.5 * f64::from(i);
            let settling = (-t_s / 3.0).exp();
            Row {
                t_s,
                t1_k: 297.0 + 0.01 * t_s,
                t2_k: 400.0,
                tc_k: 350.0 + 12.0 * (1.0 - (-t_s / 60.0).exp()),
                tc_read_k: 350.0,
                tc_slope_k_s: 0.2 * (-t_s / 60.0).exp(),
                p1_pa: 99e3,
                p2_pa: 220e3 + 3e3 * settling,
                flow_kg_s: 0.06 - 2e-3 * settling,
                tt_k: 620.0,
                oil_k: 360.0,
                ambient_k: 298.0,
                speed_rpm: 120e3,
                place: (120e3, 0.06),
            }
        };
        let rows: Vec<Row> = (12..80).map(row).collect();
        let t_s: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
        let count = rows.len();
        StepRows {
            position: 0,
            lead: (0..12).map(row).collect(),
            end: rows[count - 1],
            rows,
            smoothing: Some(Smoothing::new(&t_s)),
            noise: DMatrix::identity(count, count),
        }
    }

    /// Every column against a central difference of the prediction, for each division of the housing, before and behind the linear part of the
    /// probe's lag.
    #[test]
    fn columns_are_derivatives() {
        let step = step();
        let terms: Vec<[f64; TERM_COUNT]> =
            (0..80).map(|i| std::array::from_fn(|k| 1e-2 * f64::from(80 - i) / (1.0 + k as f64))).collect();
        let by_flow = vec![[0.0; TERM_COUNT]; terms.len()];
        let history = StepHistory { step: &step, terms, by_flow };
        let mut shared = [0.0; SHARED];
        shared[LN_COEFFICIENT] = 0.004_f64.ln() + 1.13 * 1.3e5_f64.ln();
        shared[EXPONENT] = 1.13;
        shared[ALPHA] = 0.1;
        shared[LN_HEATING_COOLING_RATIO] = 0.1;
        shared[PREHEAT] = 0.4;
        shared[TC_LAG] = 1.5;
        shared[LOGIT_INNER] = -0.5;
        shared[LN_INNER_CONDUCTANCE] = 3.0;
        shared[LOGIT_AREA] = -0.3;
        shared[LOGIT_BEARING] = 0.5;
        shared[LOGIT_THIRD] = -1.0;
        shared[LN_THIRD_CONDUCTANCE] = 2.0;
        shared[LOGIT_THIRD_AREA] = -0.7;
        shared[GAINS + 1] = 0.01;
        shared[SURFACE] = 0.6;
        shared[SURFACE + 1] = 0.1;
        let local = [0.7, 0.01, 399.0, 2.0];
        let all = [Parts::One, Parts::InnerWall, Parts::Two, Parts::Three];
        for (parts, square_mm2) in all.into_iter().flat_map(|parts| [(parts, 0.04), (parts, 2.0)]) {
            let model = model(parts);
            shared[PROBE_MM2] = square_mm2;
            let predict = |shared: &SharedVector, local: &LocalVector| {
                model.predict(&history, (shared, local), &[false; SHARED], false, None).readings_k
            };
            let columns = model.predict(&history, (&shared, &local), &[true; SHARED], true, None).columns;
            for index in 0..SHARED + LOCAL {
                let step = match index {
                    PROBE_MM2 => 1e-4,
                    HUMIDITY => 1e-5,
                    _ if (OFFSETS + 3..FLOW_GAIN).contains(&index) || index == BAROMETER => 1.0,
                    _ => 1e-4,
                };
                let at = |by: f64| {
                    let (mut shared, mut local) = (shared, local);
                    if index < SHARED {
                        shared[index] += by
                    } else {
                        local[index - SHARED] += by
                    }
                    predict(&shared, &local)
                };
                let (low, high) = (at(-step), at(step));
                let expected: Vec<f64> = high.iter().zip(&low).map(|(a, b)| (a - b) / (2.0 * step)).collect();
                let size = expected.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
                for (row, (found, expected)) in columns[index].iter().zip(&expected).enumerate() {
                    // Coefficients along a row of the inner wall are held, and so is its start: 5 % of the largest.
                    let allowed = if parts == Parts::One { 2e-2 } else { 0.05 } * size + 1e-6;
                    assert!(
                        (found - expected).abs() <= allowed,
                        "{parts:?}, parameter {index}, row {row}: {found} and {expected}, largest {size}"
                    );
                }
            }
        }
    }
}
