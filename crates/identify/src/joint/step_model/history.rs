//! Predicts the readings of T2 and Tc along a step for given parameters, with their derivatives.
//!
//! T2 follows from eqs. 1-3 and the probe. Tc is its own change: the heat to the housing, integrated over the window and divided by the heat
//! capacity, for the part with the thermocouple: `phi_c C dTc/dt = its share of q1 + q2 + sum of G_p (T_p - Tc) + q_inlet + Q + w`, with the
//! temperatures of the other parts by [`parts`](crate::joint::step_model::parts). Each parameter acts on a row by a few inputs of the gas
//! path and of the housing; the chain rule gives its column, through parts, probe and integral.

use crate::joint::step_model::gas_path::{Inputs, Slopes, Wanted};
use crate::joint::step_model::linearised::{
    Linearised, Model, RowState, StepHistory, surface_of, tc_error_k,
};
use crate::joint::step_model::parameters::{
    ALPHA, BAROMETER, ETA, FIRST_READING, FLOW_GAIN, GAINS, HUMIDITY, INLET, LN_CAPACITY, LN_DEVIATION,
    LN_HEATING_COOLING_RATIO, LOCAL, LocalVector, OFFSETS, PREHEAT, PROBE_MM2, SHARED, STEP_HEAT,
    SharedVector, TC_LAG, TERM_COUNT, THERMOMETERS, dot,
};
use crate::joint::step_model::parts::{Around, Division, OTHERS, Parts};
use crate::joint::step_model::rows::{MAX_ROW_GAP_S, Row};
use mapper_physics::rig::sensor_fault::ExactReadings;

/// The other parts of the housing at the end of a step, and their derivatives by the shared parameters.
#[derive(Debug, Clone)]
pub(crate) struct PartsAtEnd {
    t_s: f64,
    parts_k: [f64; OTHERS],
    by_shared: Box<[[f64; OTHERS]; SHARED]>,
}

/// Predicted readings, first T2, then Tc if the balance is an observation, with one column per parameter: shared ones first, then those of the
/// step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Prediction {
    pub(crate) readings_k: Vec<f64>,
    pub(crate) columns: Vec<Vec<f64>>,
    pub(crate) parts: Option<PartsAtEnd>,
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

/// Tc without its errors, K.
fn outer_k(row: &Row, shared: &SharedVector, exact_at: ExactReadings) -> f64 {
    row.tc_k + shared[TC_LAG] * row.tc_slope_k_s - tc_error_k(row.tc_k, shared, exact_at)
}

/// Error of T2 at the temperature of its probe's tip, K. At the reading, the noise would be part of the prediction, and a gain would be fitted to it.
fn t2_error_k(probe_k: f64, shared: &SharedVector, exact_at: ExactReadings) -> f64 {
    shared[OFFSETS + 1] + shared[THERMOMETERS] + shared[GAINS] * (probe_k - exact_at.temperature_k)
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
    /// other parts of the housing at the end of the step before.
    pub(crate) fn predict(
        &self,
        history: &StepHistory<'_>,
        (shared, local): (&SharedVector, &LocalVector),
        active: &[bool; SHARED],
        derivatives: bool,
        before: Option<&PartsAtEnd>,
    ) -> Prediction {
        let (linearised, start, parts_k) = {
            let wanted = if active[INLET] || active[HUMIDITY] { Wanted::Model } else { Wanted::Law };
            self.linearised(history, (shared, local), derivatives.then_some(wanted), before, (false, None))
        };
        let mut readings_k = linearised.probe.read(&linearised.gas_k, local[FIRST_READING]);
        let exact_at = self.setting.exact_at;
        readings_k.iter_mut().for_each(|reading_k| *reading_k += t2_error_k(*reading_k, shared, exact_at));
        if self.has_balance {
            readings_k.extend(linearised.tc_k(shared));
        }
        let mut prediction = Prediction { readings_k, columns: Vec::new(), parts: None };
        let last_s = history.step.rows.last().map_or(f64::NAN, |row| row.t_s);
        let mut by_shared = Box::new([[0.0; OTHERS]; SHARED]);
        if derivatives {
            prediction.columns = vec![Vec::new(); SHARED + LOCAL];
            for index in (0..SHARED).filter(|index| active[*index]) {
                let start_by = start.as_ref().map(|parts| parts.by_shared[index]);
                let (column, end_by) = linearised.by_shared(index, history, shared, local, start_by);
                prediction.columns[index] = column;
                by_shared[index] = end_by;
            }
            for index in 0..LOCAL {
                prediction.columns[SHARED + index] = linearised.by_local(index);
            }
        }
        prediction.parts =
            (self.parts != Parts::One).then_some(PartsAtEnd { t_s: last_s, parts_k, by_shared });
        prediction
    }

    /// The states along a step, the other parts of the housing it starts from, and those at its end, K. `derivatives`: see
    /// [`Setting::slopes`]. `known`: the same step with other parameters of the law, with the paths that it keeps.
    pub(crate) fn linearised<'a>(
        &'a self,
        history: &StepHistory<'a>,
        (shared, local): (&SharedVector, &LocalVector),
        derivatives: Option<Wanted>,
        before: Option<&PartsAtEnd>,
        (keeps, known): (bool, Option<&Linearised<'_>>),
    ) -> (Linearised<'a>, Option<PartsAtEnd>, [f64; OTHERS]) {
        let step = history.step;
        let has_parts = self.parts != Parts::One;
        let skipped = if has_parts { 0 } else { step.lead.len() };
        let rows: Vec<&Row> = step.lead.iter().chain(&step.rows).skip(skipped).collect();
        let division = Division::of(self.parts, shared);
        let start =
            before.filter(|parts| rows.first().is_some_and(|row| row.t_s - parts.t_s < MAX_ROW_GAP_S));
        let mut parts_k = start.map(|parts| parts.parts_k);
        let mut states = Vec::with_capacity(rows.len());
        for (i, row) in rows.iter().enumerate() {
            let terms = history.terms.get(skipped + i).unwrap_or(&[0.0; TERM_COUNT]);
            let mut inputs = self.inputs(row, terms, shared, local);
            let outer_k = inputs.outer_k;
            let capacity_j_k = self.housing.capacity_j_k(outer_k) * shared[LN_CAPACITY].exp();
            let heats_w = self.housing.heats_w(row, outer_k, shared);
            let around =
                Around { setting: &self.setting, shared, division: &division, inputs, bearing_w: heats_w[0] };
            let start_k = parts_k.unwrap_or_else(|| around.settled_k());
            let (end_k, parts) = around.along(start_k, capacity_j_k, row_width_s(&rows, i));
            parts_k = Some(end_k);
            inputs.wall_k = division.wall_k(outer_k, &parts.mean_k);
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
            let heat = if derivatives.is_some() {
                self.housing.heat_slopes(row, outer_k, shared)
            } else {
                Default::default()
            };
            let contact_w_k = path.h_w_m2k * self.setting.internal_area_m2;
            let mut outer_w = division.area[0] * (path.wall_w + contact_w_k * (inputs.wall_k - outer_k))
                + heats_w[0]
                + heats_w[1]
                + local[STEP_HEAT]
                + path.duct_w;
            for part in 0..division.others {
                outer_w += division.conductance_w_k[part] * (parts.mean_k[part] - outer_k)
                    - division.bearing[part] * heats_w[0];
            }
            let outer_j_k = division.capacity[0] * capacity_j_k;
            states.push(RowState {
                path,
                slopes,
                compressed,
                inputs,
                rate_k_s: outer_w / outer_j_k,
                outer_j_k,
                ln_capacity_by_k: self.housing.ln_capacity_by_k(outer_k),
                bearing_w: heats_w[0],
                heat,
                contact_w_k,
                parts,
            });
        }
        let lead = step.lead.len() - skipped.min(step.lead.len());
        let gas_k: Vec<f64> = states[lead..].iter().map(|state| state.path.t2_k).collect();
        let probe = self.probe(&step.rows, &gas_k, shared[PROBE_MM2]);
        let linearised = Linearised { model: self, step, states, lead, division, probe, gas_k };
        (linearised, start.cloned(), parts_k.unwrap_or_default())
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
