//! Predicts the T2 reading of a step's rows for given parameters, with its derivatives.

use crate::joint::step_model::parameters::{
    ALPHA, BAROMETER, BENDS, ETA, EXPONENT, FIRST_READING, FLOW_GAIN, GAINS, HUMIDITY, INLET, LN_COEFFICIENT,
    LN_DEVIATION, LN_HEATING_COOLING_RATIO, LOCAL, LocalVector, OFFSETS, PROBE_MM2, SHARED, SLOPE, SURFACE,
    SharedVector,
};
use crate::joint::step_model::rows::Row;
use crate::joint::step_model::surface::{TERM_COUNT, dot};
use crate::single_step::probe::{self, Lag, follow};
use mapper_core::unit_factors::M_PER_MM;
use mapper_numerics::SLOPE_STEP;
use mapper_physics::gas::air::{self, Air};
use mapper_physics::laws::compression::{
    CompressionInputs, actual_rise_k, compress, compressed_k, isentropic_rise_ratio,
    rise_ratio_by_ln_pressure,
};
use mapper_physics::laws::convection;
use mapper_physics::laws::convection::InletLaw;
use mapper_physics::rig::sensor_fault::CALIBRATED_AT_K;

/// Minimum efficiency of the model. Bound: keeps the temperature rise finite while a fit searches.
const MIN_ETA: f64 = 0.02;
/// Step of the derivative by the square of the probe's diameter, relative. Bound: between rounding and curvature.
const PROBE_STEP_RATIO: f64 = 1e-4;
/// Minimum square to which it relates, mm2. Bound: keeps the step above rounding at an ideal probe.
const MIN_PROBE_STEP_MM2: f64 = 0.1;

/// Reynolds number of a pipe.
pub(crate) fn reynolds(flow_kg_s: f64, diameter_m: f64, bulk_k: f64) -> f64 {
    4.0 * flow_kg_s / (std::f64::consts::PI * diameter_m * air::viscosity_pa_s(bulk_k))
}

/// Settings common to all steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Setting {
    pub(crate) internal_area_m2: f64,
    pub(crate) outlet_diameter_m: f64,
    pub(crate) inlet_diameter_m: f64,
    /// Pressure from which gain errors of P1 and P2 count, Pa.
    pub(crate) rest_pressure_pa: f64,
    /// The compressed air.
    pub(crate) air: Air,
    /// Reynolds number at which the law's coefficient is defined.
    pub(crate) reynolds_reference: f64,
}

/// The model's data of a step: its rows, and the surface terms at each row minus those at the step's end.
#[derive(Debug, Clone)]
pub(crate) struct StepHistory<'a> {
    pub(crate) rows: &'a [Row],
    pub(crate) terms: Vec<[f64; TERM_COUNT]>,
}

/// Predicted readings with their derivatives, one column per parameter: shared parameters first, then those of the step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Prediction {
    pub(crate) t2_k: Vec<f64>,
    pub(crate) columns: Vec<Vec<f64>>,
}

/// Gas properties along the flow path, one row.
#[derive(Debug, Clone, Copy)]
struct Gas {
    t1_k: f64,
    tc_k: f64,
    flow_kg_s: f64,
    rise_ratio: f64,
    eta: f64,
    /// The compressed air.
    air: Air,
}

/// Convection along the flow path, one row.
#[derive(Debug, Clone, Copy)]
struct Convection {
    /// After the wheel, W/(m2 K).
    h_w_m2k: f64,
    /// Temperature at which the gas properties are taken, K.
    bulk_k: f64,
    /// h before the wheel over that after it.
    inlet_h_ratio: f64,
}

/// First-order sensitivities of convection to the gas state: each further derivative then costs only a few products.
#[derive(Debug, Clone, Copy)]
struct Answer {
    /// Derivative of ln h with respect to the temperature of the gas properties, 1/K.
    ln_h_by_bulk: f64,
    /// Derivative of the ratio of h before the wheel to h after it with respect to the same temperature, 1/K.
    inlet_by_bulk: f64,
    /// Derivative of ln h with respect to the metal temperature, 1/K.
    ln_h_by_metal: f64,
    /// Derivative of ln h with respect to ln of the flow.
    ln_h_by_ln_flow: f64,
}

impl Answer {
    /// Convection for a small change of the gas from `gas`, at the same inlet temperature.
    fn moved(&self, from: &Convection, gas: &Gas, to: &Gas) -> Convection {
        let bulk_k = compressed_k(to.t1_k, to.rise_ratio, to.eta, to.air);
        let by_k = bulk_k - from.bulk_k;
        let ln_h = self.ln_h_by_bulk * by_k
            + self.ln_h_by_metal * (to.tc_k - gas.tc_k)
            + self.ln_h_by_ln_flow * (to.flow_kg_s / gas.flow_kg_s - 1.0);
        Convection {
            h_w_m2k: from.h_w_m2k * (1.0 + ln_h),
            bulk_k,
            inlet_h_ratio: from.inlet_h_ratio + self.inlet_by_bulk * by_k,
        }
    }
}

impl Setting {
    /// Sensitivities of convection, which is `here` at `gas`.
    fn answer(&self, gas: &Gas, here: &Convection, shared: &SharedVector, ln_deviation: f64) -> Answer {
        let step_k = here.bulk_k * SLOPE_STEP;
        // In the law, pressure changes only the bulk temperature.
        let rise_ratio = gas.eta * actual_rise_k(gas.t1_k, here.bulk_k + step_k, gas.air) / gas.t1_k;
        let hotter = self.h(&Gas { rise_ratio, ..*gas }, shared, ln_deviation);
        let by_k = hotter.bulk_k - here.bulk_k;
        let metal_k = gas.tc_k * (1.0 + SLOPE_STEP);
        let viscosity_ratio = air::viscosity_pa_s(gas.tc_k) / air::viscosity_pa_s(metal_k);
        Answer {
            ln_h_by_bulk: (hotter.h_w_m2k / here.h_w_m2k - 1.0) / by_k,
            inlet_by_bulk: (hotter.inlet_h_ratio - here.inlet_h_ratio) / by_k,
            ln_h_by_metal: convection::WALL_EXPONENT * (viscosity_ratio - 1.0) / (metal_k - gas.tc_k),
            ln_h_by_ln_flow: shared[EXPONENT],
        }
    }

    /// Heat-transfer coefficients from the law.
    fn h(&self, gas: &Gas, shared: &SharedVector, ln_deviation: f64) -> Convection {
        let bulk_k = compressed_k(gas.t1_k, gas.rise_ratio, gas.eta, gas.air);
        let inlet_h_ratio = if shared[INLET] == 0.0 {
            1.0
        } else {
            (shared[INLET] * self.ln_inlet_ratio(gas, shared, bulk_k)).exp()
        };
        let exponent = shared[EXPONENT];
        let ln_coefficient = shared[LN_COEFFICIENT] + ln_deviation - exponent * self.reynolds_reference.ln();
        let h_w_m2k = convection::coefficient_w_m2k(
            ln_coefficient.exp(),
            exponent,
            self.outlet_diameter_m,
            gas.flow_kg_s,
            bulk_k,
            gas.tc_k,
        );
        Convection { h_w_m2k, bulk_k, inlet_h_ratio }
    }

    /// ln of the ratio of h before the wheel to h after it, by the inlet's own law.
    fn ln_inlet_ratio(&self, gas: &Gas, shared: &SharedVector, bulk_k: f64) -> f64 {
        let law = InletLaw {
            exponent: shared[EXPONENT],
            inlet_diameter_m: self.inlet_diameter_m,
            outlet_diameter_m: self.outlet_diameter_m,
        };
        law.h_ratio(gas.t1_k, bulk_k).ln()
    }

    /// T2 by eqs. 1-3. The heating/cooling ratio scales h if the metal is the hotter one. Eqs. 1-3 have one h, so each part of the area is
    /// scaled instead.
    fn t2_k(&self, gas: &Gas, convection: Convection, alpha: f64, ln_heating_cooling_ratio: f64) -> f64 {
        let Convection { h_w_m2k, bulk_k, inlet_h_ratio } = convection;
        let outward = |hotter: bool| {
            if hotter && ln_heating_cooling_ratio != 0.0 { ln_heating_cooling_ratio.exp() } else { 1.0 }
        };
        let before_m2 = outward(gas.tc_k > gas.t1_k) * alpha * self.internal_area_m2;
        let pass = |after_m2: f64| {
            let inputs = CompressionInputs {
                t1_k: gas.t1_k,
                tc_k: gas.tc_k,
                flow_kg_s: gas.flow_kg_s,
                isentropic_rise_ratio: gas.rise_ratio,
                efficiency: gas.eta,
                h_w_m2k,
                inlet_h_ratio,
                alpha_area_ratio: before_m2 / (before_m2 + after_m2),
                internal_area_m2: before_m2 + after_m2,
                air: gas.air,
            };
            compress(&inputs, Some(bulk_k))
        };
        let after_m2 = (1.0 - alpha) * self.internal_area_m2;
        let plain = pass(after_m2);
        if ln_heating_cooling_ratio != 0.0 && gas.tc_k > plain.t2_prime_k {
            return pass(after_m2 * outward(true)).t2_k;
        }
        plain.t2_k
    }

    fn reynolds(&self, flow_kg_s: f64, bulk_k: f64) -> f64 {
        reynolds(flow_kg_s, self.outlet_diameter_m, bulk_k)
    }

    fn gas(&self, row: &Row, terms: &[f64; TERM_COUNT], shared: &SharedVector, local: &LocalVector) -> Gas {
        let offset = |index: usize| shared[OFFSETS + index];
        let t1_k = row.t1_k - offset(0);
        let [p1_pa, p2_pa] = pressures_pa(row, shared, self.rest_pressure_pa);
        let pressure_ratio = p2_pa / p1_pa;
        let humidity_kg_kg = self.air.humidity_kg_kg() + shared[HUMIDITY];
        let air = self.air.with_humidity(humidity_kg_kg).between(p1_pa, p2_pa);
        let slope = local[SLOPE] * dot(terms, surface_of(shared));
        Gas {
            t1_k,
            tc_k: row.tc_k - offset(2) - shared[GAINS + 1] * (row.tc_k - CALIBRATED_AT_K),
            flow_kg_s: row.flow_kg_s / (1.0 + shared[FLOW_GAIN]),
            rise_ratio: isentropic_rise_ratio(pressure_ratio, t1_k, air),
            air,
            eta: (local[ETA] + slope).max(MIN_ETA),
        }
    }

    /// ln of the ratio of h before the wheel to h after it, by the inlet's own law, at a step's end.
    pub(crate) fn ln_inlet_ratio_at(&self, end: &Row, shared: &SharedVector, local: &LocalVector) -> f64 {
        let gas = self.gas(end, &[0.0; TERM_COUNT], shared, local);
        self.ln_inlet_ratio(&gas, shared, compressed_k(gas.t1_k, gas.rise_ratio, gas.eta, gas.air))
    }

    /// h at a step's end, W/(m2 K), and ln of its Reynolds number over the reference.
    pub(crate) fn h_at_end(&self, end: &Row, shared: &SharedVector, local: &LocalVector) -> (f64, f64) {
        let gas = self.gas(end, &[0.0; TERM_COUNT], shared, local);
        let Convection { h_w_m2k, bulk_k, .. } = self.h(&gas, shared, local[LN_DEVIATION]);
        (h_w_m2k, (self.reynolds(gas.flow_kg_s, bulk_k) / self.reynolds_reference).ln())
    }

    /// Derivative of T2 at a step's end with respect to each reading: T1, T2, Tc, P1, P2, flow. Gives the effect of sensor noise.
    pub(crate) fn sensitivities(&self, end: &Row, shared: &SharedVector, local: &LocalVector) -> [f64; 6] {
        let history = StepHistory { rows: std::slice::from_ref(end), terms: vec![[0.0; TERM_COUNT]] };
        let ideal = {
            let mut ideal = *shared;
            ideal[PROBE_MM2] = 0.0;
            ideal
        };
        let mut active = [false; SHARED];
        active[OFFSETS..=FLOW_GAIN].fill(true);
        let columns = self.predict(&history, &ideal, local, &active, true).columns;
        let at = |index: usize| columns.get(index).and_then(|column| column.first()).copied().unwrap_or(0.0);
        [
            at(OFFSETS),
            at(OFFSETS + 1),
            at(OFFSETS + 2),
            at(OFFSETS + 3),
            at(OFFSETS + 4),
            at(FLOW_GAIN) / end.flow_kg_s,
        ]
    }

    /// Derivative of T2 at a step's end with respect to the efficiency, K.
    pub(crate) fn by_efficiency(&self, end: &Row, shared: &SharedVector, local: &LocalVector) -> f64 {
        let at = |eta: f64| {
            let mut moved = *local;
            moved[ETA] = eta;
            let gas = self.gas(end, &[0.0; TERM_COUNT], shared, &moved);
            self.t2_k(
                &gas,
                self.h(&gas, shared, moved[LN_DEVIATION]),
                shared[ALPHA],
                shared[LN_HEATING_COOLING_RATIO],
            )
        };
        (at(local[ETA] + SLOPE_STEP) - at(local[ETA] - SLOPE_STEP)) / (2.0 * SLOPE_STEP)
    }

    pub(crate) fn predict_t2_k(
        &self,
        history: &StepHistory<'_>,
        shared: &SharedVector,
        local: &LocalVector,
    ) -> Vec<f64> {
        self.predict(history, shared, local, &[false; SHARED], false).t2_k
    }

    /// Predicts T2, with derivatives by the parameters in `active` and by those of the step if `derivatives` is set.
    pub(crate) fn predict(
        &self,
        history: &StepHistory<'_>,
        shared: &SharedVector,
        local: &LocalVector,
        active: &[bool; SHARED],
        derivatives: bool,
    ) -> Prediction {
        let n = history.rows.len();
        let mut gas_k = Vec::with_capacity(n);
        let mut columns = vec![Vec::new(); if derivatives { SHARED + LOCAL } else { 0 }];
        if derivatives {
            for (index, column) in columns.iter_mut().enumerate() {
                if index >= SHARED || active[index] {
                    *column = vec![0.0; n];
                }
            }
        }
        let (alpha, ln_heating_cooling_ratio, deviation) =
            (shared[ALPHA], shared[LN_HEATING_COOLING_RATIO], local[LN_DEVIATION]);
        for (i, (row, terms)) in history.rows.iter().zip(&history.terms).enumerate() {
            let gas = self.gas(row, terms, shared, local);
            let h = self.h(&gas, shared, deviation);
            let t2_k = self.t2_k(&gas, h, alpha, ln_heating_cooling_ratio);
            gas_k.push(t2_k);
            if !derivatives {
                continue;
            }
            let answer = self.answer(&gas, &h, shared, deviation);
            let full = |to: Gas, step: f64| {
                (self.t2_k(&to, answer.moved(&h, &gas, &to), alpha, ln_heating_cooling_ratio) - t2_k) / step
            };
            let by_eta = full(Gas { eta: gas.eta + SLOPE_STEP, ..gas }, SLOPE_STEP);
            let by_ln_h = (self.t2_k(
                &gas,
                Convection { h_w_m2k: h.h_w_m2k * (1.0 + SLOPE_STEP), ..h },
                alpha,
                ln_heating_cooling_ratio,
            ) - t2_k)
                / SLOPE_STEP;
            let mut put = |index: usize, value: f64| {
                if let Some(cell) = columns[index].get_mut(i) {
                    *cell = value;
                }
            };
            put(SHARED + ETA, by_eta);
            put(SHARED + LN_DEVIATION, by_ln_h);
            put(SHARED + SLOPE, by_eta * dot(terms, surface_of(shared)));
            for (k, term) in terms.iter().enumerate() {
                put(SURFACE + k, by_eta * local[SLOPE] * term);
            }
            put(LN_COEFFICIENT, by_ln_h);
            let ln_reynolds = (self.reynolds(gas.flow_kg_s, h.bulk_k) / self.reynolds_reference).ln();
            put(EXPONENT, by_ln_h * ln_reynolds);
            if active[INLET] || shared[INLET] != 0.0 {
                let moved = Convection { inlet_h_ratio: h.inlet_h_ratio * (1.0 + SLOPE_STEP), ..h };
                let by_ln_inlet =
                    (self.t2_k(&gas, moved, alpha, ln_heating_cooling_ratio) - t2_k) / SLOPE_STEP;
                put(INLET, by_ln_inlet * self.ln_inlet_ratio(&gas, shared, h.bulk_k));
                // The exponent applies to the Reynolds numbers on both sides.
                let ln_inlet_over_outlet = (self.outlet_diameter_m * air::viscosity_pa_s(h.bulk_k)
                    / (self.inlet_diameter_m * air::viscosity_pa_s(gas.t1_k)))
                .ln();
                put(EXPONENT, by_ln_h * ln_reynolds + by_ln_inlet * shared[INLET] * ln_inlet_over_outlet);
            }
            if active[ALPHA] {
                put(
                    ALPHA,
                    (self.t2_k(&gas, h, alpha + SLOPE_STEP, ln_heating_cooling_ratio) - t2_k) / SLOPE_STEP,
                );
            }
            if active[LN_HEATING_COOLING_RATIO] {
                // Stay away from 0, where the factor is switched off.
                let step = if ln_heating_cooling_ratio == -SLOPE_STEP { -SLOPE_STEP } else { SLOPE_STEP };
                put(
                    LN_HEATING_COOLING_RATIO,
                    (self.t2_k(&gas, h, alpha, ln_heating_cooling_ratio + step) - t2_k) / step,
                );
            }
            if active[OFFSETS] {
                let (step, t1_k) = (gas.t1_k * SLOPE_STEP, gas.t1_k * (1.0 + SLOPE_STEP));
                let [p1_pa, p2_pa] = pressures_pa(row, shared, self.rest_pressure_pa);
                let moved =
                    Gas { t1_k, rise_ratio: isentropic_rise_ratio(p2_pa / p1_pa, t1_k, gas.air), ..gas };
                let convection = self.h(&moved, shared, deviation);
                put(OFFSETS, -(self.t2_k(&moved, convection, alpha, ln_heating_cooling_ratio) - t2_k) / step);
            }
            put(OFFSETS + 1, 1.0);
            put(GAINS, t2_k - CALIBRATED_AT_K);
            if active[OFFSETS + 2] || active[GAINS + 1] {
                let step = gas.tc_k * SLOPE_STEP;
                let by_reading = -full(Gas { tc_k: gas.tc_k + step, ..gas }, step);
                put(OFFSETS + 2, by_reading);
                put(GAINS + 1, by_reading * (row.tc_k - CALIBRATED_AT_K));
            }
            if [OFFSETS + 3, OFFSETS + 4, GAINS + 2, GAINS + 3, BAROMETER].iter().any(|index| active[*index])
            {
                let by_rise = full(Gas { rise_ratio: gas.rise_ratio + SLOPE_STEP, ..gas }, SLOPE_STEP);
                let by_ln_ratio = by_rise * rise_ratio_by_ln_pressure(gas.rise_ratio, gas.t1_k, gas.air);
                let [p1_pa, p2_pa] = pressures_pa(row, shared, self.rest_pressure_pa);
                let (by_p1, by_p2) = (by_ln_ratio / p1_pa, -by_ln_ratio / p2_pa);
                put(OFFSETS + 3, by_p1);
                put(OFFSETS + 4, by_p2);
                put(GAINS + 2, by_p1 * (row.p1_pa - self.rest_pressure_pa));
                put(GAINS + 3, by_p2 * (row.p2_pa - self.rest_pressure_pa));
                put(BAROMETER, by_p1 + by_p2);
            }
            if active[FLOW_GAIN] {
                let step = gas.flow_kg_s * SLOPE_STEP;
                let by_flow = full(Gas { flow_kg_s: gas.flow_kg_s + step, ..gas }, step);
                put(FLOW_GAIN, -by_flow * gas.flow_kg_s / (1.0 + shared[FLOW_GAIN]));
            }
            if active[HUMIDITY] {
                let [p1_pa, p2_pa] = pressures_pa(row, shared, self.rest_pressure_pa);
                let air = gas.air.with_humidity(gas.air.humidity_kg_kg() + SLOPE_STEP);
                let rise_ratio = isentropic_rise_ratio(p2_pa / p1_pa, gas.t1_k, air);
                put(HUMIDITY, full(Gas { air, rise_ratio, ..gas }, SLOPE_STEP));
            }
        }
        self.through_probe(history.rows, gas_k, columns, shared, local, active)
    }

    /// Lag of the probe from row to row, for the square of its diameter.
    pub(crate) fn lags(&self, rows: &[Row], gas_k: &[f64], square_mm2: f64) -> Vec<Lag> {
        let diameter_m = M_PER_MM * square_mm2.max(0.0).sqrt();
        let rows = rows.iter().zip(gas_k).map(|(row, gas_k)| (row.t_s, row.flow_kg_s, *gas_k));
        probe::lags(rows, diameter_m, self.outlet_diameter_m)
    }

    /// Applies the probe's lag to the gas temperature and to every derivative.
    fn through_probe(
        &self,
        rows: &[Row],
        gas_k: Vec<f64>,
        mut columns: Vec<Vec<f64>>,
        shared: &SharedVector,
        local: &LocalVector,
        active: &[bool; SHARED],
    ) -> Prediction {
        let offset_k = shared[OFFSETS + 1];
        let ideal = shared[PROBE_MM2] <= 0.0 && !active[PROBE_MM2];
        if ideal || rows.len() < 2 {
            let t2_k = gas_k.iter().map(|gas| gas + offset_k).collect();
            return Prediction { t2_k, columns };
        }
        let lags_at = |square_mm2: f64| self.lags(rows, &gas_k, square_mm2);
        let lags = lags_at(shared[PROBE_MM2]);
        let first_k = local[FIRST_READING];
        let readings = follow(&lags, first_k, &gas_k);
        for (index, column) in columns.iter_mut().enumerate() {
            let own_offset = index == OFFSETS + 1 || index == GAINS;
            if !column.is_empty() && !own_offset && index != PROBE_MM2 && index != SHARED + FIRST_READING {
                // The first reading is a separate parameter.
                *column = follow(&lags, 0.0, column);
            }
        }
        if !columns.is_empty() {
            let zeros = vec![0.0; gas_k.len()];
            columns[SHARED + FIRST_READING] = follow(&lags, 1.0, &zeros);
            if active[PROBE_MM2] {
                let step = PROBE_STEP_RATIO * shared[PROBE_MM2].max(MIN_PROBE_STEP_MM2);
                let moved = follow(&lags_at(shared[PROBE_MM2] + step), first_k, &gas_k);
                columns[PROBE_MM2] = moved.iter().zip(&readings).map(|(a, b)| (a - b) / step).collect();
            }
        }
        Prediction { t2_k: readings.iter().map(|reading| reading + offset_k).collect(), columns }
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

/// The surface coefficients among the shared parameters.
pub(crate) fn surface_of(shared: &SharedVector) -> &[f64; TERM_COUNT] {
    shared.get(SURFACE..BENDS).and_then(|tail| tail.try_into().ok()).unwrap_or(&[0.0; TERM_COUNT])
}
