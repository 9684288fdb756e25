//! The gas path of the model of a step, and its housing.

use crate::config::{Housing, IdentifyConfig};
use crate::joint::step_model::parameters::{
    BEARING, EXPONENT, EXTERNAL, HEAT, HEAT_BY_TC, LN_COEFFICIENT, LN_OIL, RADIATION, SharedVector,
};
use crate::joint::step_model::rows::Row;
use mapper_numerics::SLOPE_STEP;
use mapper_physics::gas::air::{self, Air};
use mapper_physics::laws::compression::{
    Wheel, after_wheel, before_wheel, compressed_k, isentropic_rise_ratio,
};
use mapper_physics::laws::convection::{self, InletLaw};
use mapper_physics::laws::housing::{
    bearing_conductance_w_k, bearing_k, capacity_j_k, external_heat_w, friction_heat_w, radiation_w,
};
use mapper_physics::machine::params::rad_s_of_rpm;
use mapper_physics::rig::sensor_fault::ExactReadings;

/// Minimum efficiency of the model. Bound: keeps the temperature rise finite while a fit searches.
const MIN_ETA: f64 = 0.02;

/// Number of quantities that act on the gas path. Source: the fields of [`Inputs`]; both pressures act by their ratio.
pub(crate) const INPUT_COUNT: usize = 12;

/// Place of an input in the derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub(crate) enum Input {
    /// T1, K.
    T1 = 0,
    /// Wall that the gas touches, K.
    Wall = 1,
    /// Outer part of the housing, K.
    Outer = 2,
    /// ln of the pressure ratio.
    LnPressureRatio = 3,
    /// Flow, kg/s.
    Flow = 4,
    /// Efficiency.
    Eta = 5,
    /// ln of h.
    LnH = 6,
    /// alpha_A.
    Alpha = 7,
    /// ln of the heating/cooling ratio.
    LnRatio = 8,
    /// Conductance of the inlet, W/K.
    Preheat = 9,
    /// Degree to which h before the wheel follows the inlet's own law.
    Inlet = 10,
    /// Water, kg/kg.
    Humidity = 11,
}

/// The state of one row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Inputs {
    pub(crate) t1_k: f64,
    pub(crate) wall_k: f64,
    pub(crate) outer_k: f64,
    pub(crate) p1_pa: f64,
    pub(crate) p2_pa: f64,
    pub(crate) flow_kg_s: f64,
    pub(crate) eta: f64,
    /// Change of ln h about the law.
    pub(crate) ln_h: f64,
    pub(crate) alpha_area_ratio: f64,
    pub(crate) ln_heating_cooling_ratio: f64,
    pub(crate) preheat_w_k: f64,
    pub(crate) inlet_power: f64,
    /// Change of the humidity, kg/kg.
    pub(crate) humidity_kg_kg: f64,
}

/// What the gas does.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct GasPath {
    /// Gas at the outlet, K.
    pub(crate) t2_k: f64,
    /// Heat from the gas to the wall that it touches, W.
    pub(crate) wall_w: f64,
    /// Heat from the gas to the outer part through the inlet, W.
    pub(crate) duct_w: f64,
    /// h after the wheel, W/(m2 K).
    pub(crate) h_w_m2k: f64,
    /// Temperature at which the gas properties are taken, K.
    pub(crate) bulk_k: f64,
    /// Heat capacity there, J/(kg K).
    bulk_cp_j_kgk: f64,
    /// h with a coefficient of 1, W/(m2 K), and the exponent of its law.
    h_of_unit_w_m2k: f64,
    exponent: f64,
    /// Gas before the wheel and behind it, K.
    wheel_k: (f64, f64),
    inlet: InletGas,
}

/// The gas before the wheel.
#[derive(Debug, Clone, Copy, Default)]
struct InletGas {
    rise_ratio: f64,
    cp_j_kgk: f64,
}

/// Derivatives of T2, heat to the wall, heat of the inlet and conductance between gas and wall by each input.
pub(crate) type Slopes = [[f64; 4]; INPUT_COUNT];

/// Which derivatives are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Wanted {
    /// Those by readings and efficiency.
    Readings,
    /// Also those by the law of convection and by what acts before the wheel.
    Law,
    /// Also those by the inlet's own law and by the humidity.
    Model,
}

/// The gas path with another T1, another pressure ratio and another efficiency: what the derivatives spend their time on, and what no
/// parameter of the law changes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Compressed {
    other_t1: GasPath,
    other_pressure: GasPath,
    other_eta: GasPath,
}

/// Settings common to all steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Setting {
    pub(crate) internal_area_m2: f64,
    pub(crate) outlet_diameter_m: f64,
    pub(crate) inlet_diameter_m: f64,
    /// Readings from which gain errors count.
    pub(crate) exact_at: ExactReadings,
    /// The compressed air.
    pub(crate) air: Air,
    /// Reynolds number at which the law's coefficient is defined.
    pub(crate) reynolds_reference: f64,
}

/// Reynolds number of a pipe times its diameter and viscosity, over the flow. Source: 4 m/(pi D mu).
const REYNOLDS_FACTOR: f64 = 4.0 / std::f64::consts::PI;

/// Reynolds number of a pipe.
pub(crate) fn reynolds(flow_kg_s: f64, diameter_m: f64, bulk_k: f64) -> f64 {
    REYNOLDS_FACTOR * flow_kg_s / (diameter_m * air::viscosity_pa_s(bulk_k))
}

impl Setting {
    pub(crate) fn of(config: &IdentifyConfig, reynolds_reference: f64) -> Self {
        Setting {
            exact_at: config.exact_at,
            air: config.air,
            internal_area_m2: config.internal_area_m2,
            outlet_diameter_m: config.outlet_diameter_m,
            inlet_diameter_m: config.inlet_diameter_m,
            reynolds_reference,
        }
    }

    fn air(&self, inputs: &Inputs) -> Air {
        self.air
            .with_humidity(self.air.humidity_kg_kg() + inputs.humidity_kg_kg)
            .between(inputs.p1_pa, inputs.p2_pa)
    }

    /// Eqs. 1-3 with the law of h, a heating/cooling ratio and an inlet that preheats.
    pub(crate) fn gas_path(&self, inputs: &Inputs, shared: &SharedVector) -> GasPath {
        self.gas_path_near(None, inputs, shared)
    }

    /// The same, with what `known` inputs and their path already have: properties, efficiency and wheel take most of the time, and most inputs
    /// leave most of them as they are.
    pub(crate) fn gas_path_near(
        &self,
        known: Option<(&Inputs, &GasPath)>,
        inputs: &Inputs,
        shared: &SharedVector,
    ) -> GasPath {
        let Inputs { t1_k, wall_k, outer_k, flow_kg_s, .. } = *inputs;
        let before_compression = |x: &Inputs| (x.t1_k, x.p1_pa, x.p2_pa, x.humidity_kg_kg);
        let same_inlet = known.filter(|(of, _)| before_compression(of) == before_compression(inputs));
        let inlet = same_inlet.map_or_else(
            || {
                let air = self.air(inputs);
                let rise_ratio = isentropic_rise_ratio(inputs.p2_pa / inputs.p1_pa, t1_k, air);
                InletGas { rise_ratio, cp_j_kgk: air.heat_capacity_j_kgk(t1_k) }
            },
            |(_, path)| path.inlet,
        );
        let InletGas { rise_ratio, cp_j_kgk } = inlet;
        let efficiency = inputs.eta.max(MIN_ETA);
        let same_bulk = same_inlet.filter(|(of, _)| of.eta == inputs.eta);
        let (bulk_k, bulk_cp_j_kgk) = same_bulk.map_or_else(
            || {
                let air = self.air(inputs);
                let bulk_k = compressed_k(t1_k, rise_ratio, efficiency, air);
                (bulk_k, air.heat_capacity_j_kgk(bulk_k))
            },
            |(_, path)| (path.bulk_k, path.bulk_cp_j_kgk),
        );
        let exponent = shared[EXPONENT];
        let same_h = same_bulk
            .filter(|(of, path)| (of.wall_k, of.flow_kg_s, path.exponent) == (wall_k, flow_kg_s, exponent));
        let h_of_unit_w_m2k = same_h.map_or_else(
            || {
                let diameter_m = self.outlet_diameter_m;
                convection::coefficient_w_m2k(1.0, exponent, diameter_m, flow_kg_s, bulk_k, wall_k)
            },
            |(_, path)| path.h_of_unit_w_m2k,
        );
        let ln_coefficient = shared[LN_COEFFICIENT] + inputs.ln_h - exponent * self.reynolds_reference.ln();
        let h_w_m2k = ln_coefficient.exp() * h_of_unit_w_m2k;
        let ln_inlet_ratio = || {
            let law = InletLaw {
                exponent,
                inlet_diameter_m: self.inlet_diameter_m,
                outlet_diameter_m: self.outlet_diameter_m,
            };
            law.h_ratio(t1_k, bulk_k).ln()
        };
        let inlet_h_ratio =
            if inputs.inlet_power == 0.0 { 1.0 } else { (inputs.inlet_power * ln_inlet_ratio()).exp() };
        let conductance_w_k = h_w_m2k * self.internal_area_m2;
        let directed_w_k = |gas_k: f64| {
            if wall_k > gas_k {
                conductance_w_k * inputs.ln_heating_cooling_ratio.exp()
            } else {
                conductance_w_k
            }
        };
        let before_w_k = directed_w_k(t1_k) * inlet_h_ratio * inputs.alpha_area_ratio;
        let (q1_w, after_area_k) = before_wheel(before_w_k, t1_k, wall_k, flow_kg_s, cp_j_kgk);
        let duct_w = inputs.preheat_w_k * (t1_k - outer_k);
        let t1_prime_k = after_area_k - duct_w / (flow_kg_s * cp_j_kgk);
        let same_wheel = same_bulk.filter(|(_, path)| path.wheel_k.0 == t1_prime_k);
        let t2_prime_k = same_wheel.map_or_else(
            || {
                let (isentropic_rise_ratio, air) = (rise_ratio, self.air(inputs));
                Wheel { t1_k, isentropic_rise_ratio, efficiency, recirculation_ratio: 0.0, air }
                    .compress(t1_prime_k)
                    .0
            },
            |(_, path)| path.wheel_k.1,
        );
        let after_w_k = directed_w_k(t2_prime_k) * (1.0 - inputs.alpha_area_ratio);
        let (q2_w, t2_k) = after_wheel(after_w_k, t2_prime_k, wall_k, flow_kg_s, bulk_cp_j_kgk);
        let wheel_k = (t1_prime_k, t2_prime_k);
        GasPath {
            t2_k,
            wall_w: q1_w + q2_w,
            duct_w,
            h_w_m2k,
            bulk_k,
            bulk_cp_j_kgk,
            h_of_unit_w_m2k,
            exponent,
            wheel_k,
            inlet,
        }
    }

    /// ln of the Reynolds number over the reference.
    pub(crate) fn ln_reynolds(&self, inputs: &Inputs, path: &GasPath) -> f64 {
        (reynolds(inputs.flow_kg_s, self.outlet_diameter_m, path.bulk_k) / self.reynolds_reference).ln()
    }

    /// ln of the ratio of h before the wheel to h after it by the inlet's own law.
    pub(crate) fn ln_inlet_ratio(&self, inputs: &Inputs, path: &GasPath, shared: &SharedVector) -> f64 {
        let law = InletLaw {
            exponent: shared[EXPONENT],
            inlet_diameter_m: self.inlet_diameter_m,
            outlet_diameter_m: self.outlet_diameter_m,
        };
        law.h_ratio(inputs.t1_k, path.bulk_k).ln()
    }

    /// Heat from the gas to its wall, W, what it falls by per kelvin of the wall, and the conductance between them, W/K.
    pub(crate) fn wall_heat(&self, inputs: &Inputs, shared: &SharedVector) -> (f64, f64, f64) {
        let here = self.gas_path(inputs, shared);
        let step_k = SLOPE_STEP * inputs.wall_k;
        let hotter = Inputs { wall_k: inputs.wall_k + step_k, ..*inputs };
        let hotter_w = self.gas_path_near(Some((inputs, &here)), &hotter, shared).wall_w;
        (here.wall_w, (here.wall_w - hotter_w) / step_k, here.h_w_m2k * self.internal_area_m2)
    }

    /// The derivatives, by difference quotients, those that are not wanted 0. `known`: paths found before.
    pub(crate) fn slopes(
        &self,
        inputs: &Inputs,
        here: &GasPath,
        known: Option<(&Inputs, &Compressed)>,
        shared: &SharedVector,
        wanted: Wanted,
    ) -> (Slopes, Compressed) {
        let quotient = |there: &GasPath, step: f64| {
            [
                (there.t2_k - here.t2_k) / step,
                (there.wall_w - here.wall_w) / step,
                (there.duct_w - here.duct_w) / step,
                (there.h_w_m2k - here.h_w_m2k) * self.internal_area_m2 / step,
            ]
        };
        let by = |moved: Inputs, step: f64| {
            quotient(&self.gas_path_near(Some((inputs, here)), &moved, shared), step)
        };
        let by_law =
            |moved: Inputs, step: f64| if wanted >= Wanted::Law { by(moved, step) } else { [0.0; 4] };
        let by_model =
            |moved: Inputs, step: f64| if wanted >= Wanted::Model { by(moved, step) } else { [0.0; 4] };
        let x = *inputs;
        let kelvin = SLOPE_STEP * x.t1_k;
        let flow = SLOPE_STEP * x.flow_kg_s;
        let none = [0.0; 4];
        let hotter = |x: &Inputs| Inputs { t1_k: x.t1_k + kelvin, ..*x };
        let higher = |x: &Inputs| Inputs { p2_pa: x.p2_pa * SLOPE_STEP.exp(), ..*x };
        let better = |x: &Inputs| Inputs { eta: x.eta + SLOPE_STEP, ..*x };
        let compressed = |moved: &dyn Fn(&Inputs) -> Inputs, of: fn(&Compressed) -> &GasPath| match known {
            Some((inputs, known)) => {
                self.gas_path_near(Some((&moved(inputs), of(known))), &moved(&x), shared)
            }
            None => self.gas_path_near(Some((inputs, here)), &moved(&x), shared),
        };
        let other_t1 = compressed(&hotter, |known| &known.other_t1);
        let other_pressure = compressed(&higher, |known| &known.other_pressure);
        let other_eta = compressed(&better, |known| &known.other_eta);
        let is_hot_wall = x.wall_k > x.t1_k || x.wall_k > here.t2_k;
        let slopes = [
            quotient(&other_t1, kelvin),
            by(Inputs { wall_k: x.wall_k + kelvin, ..x }, kelvin),
            if x.preheat_w_k == 0.0 { none } else { by(Inputs { outer_k: x.outer_k + kelvin, ..x }, kelvin) },
            quotient(&other_pressure, SLOPE_STEP),
            by(Inputs { flow_kg_s: x.flow_kg_s + flow, ..x }, flow),
            quotient(&other_eta, SLOPE_STEP),
            by_law(Inputs { ln_h: x.ln_h + SLOPE_STEP, ..x }, SLOPE_STEP),
            by_law(Inputs { alpha_area_ratio: x.alpha_area_ratio + SLOPE_STEP, ..x }, SLOPE_STEP),
            if is_hot_wall {
                let ln_heating_cooling_ratio = x.ln_heating_cooling_ratio + SLOPE_STEP;
                by_law(Inputs { ln_heating_cooling_ratio, ..x }, SLOPE_STEP)
            } else {
                none
            },
            by_law(Inputs { preheat_w_k: x.preheat_w_k + SLOPE_STEP, ..x }, SLOPE_STEP),
            by_model(Inputs { inlet_power: x.inlet_power + SLOPE_STEP, ..x }, SLOPE_STEP),
            by_model(Inputs { humidity_kg_kg: x.humidity_kg_kg + SLOPE_STEP, ..x }, SLOPE_STEP),
        ];
        (slopes, Compressed { other_t1, other_pressure, other_eta })
    }
}

// The heat that the compressor housing exchanges with everything but the gas.
// `Q = G_b (T_b(Tt, Tc, T_oil) - Tc) - free convection - radiation to the cell + F A sigma (Tt^4 - Tc^4) + c0 + c1 (Tc - 330 K)`, by
// Appendix A of the paper, with a relative error of each part. `c0` and `c1` are heat from another source: constant, and in proportion to
// Tc, as a coolant. Without the temperatures of turbine housing and oil they also stand for bearing and turbine.

/// Housing temperature from which heat in proportion to it counts, K. Bound: the middle of a warm compressor; another one moves the
/// constant part.
const MIDDLE_TC_K: f64 = 330.0;
/// Step of the derivative by Tc, K. Bound: between rounding and curvature.
const TC_STEP_K: f64 = 1e-2;
/// Parameters of the heat.
pub(crate) const HEAT_PARAMETERS: [usize; 6] = [EXTERNAL, BEARING, LN_OIL, RADIATION, HEAT, HEAT_BY_TC];
/// Derivatives of both heats by [`HEAT_PARAMETERS`] and, last, by Tc.
pub(crate) type HeatSlopes = [[f64; 2]; HEAT_PARAMETERS.len() + 1];
/// Steps of the derivatives by them, in their units. Bound: the heat is linear in all but the conductance to the oil.
const STEPS: [f64; 6] = [1e-4, 1e-4, 1e-4, 1e-5, 1e-2, 1e-4];

impl Housing {
    /// Heat capacity, J/K.
    pub(crate) fn capacity_j_k(&self, tc_k: f64) -> f64 {
        capacity_j_k(self.mass_kg, tc_k)
    }

    /// Derivative of the logarithm of the heat capacity by Tc, 1/K.
    pub(crate) fn ln_capacity_by_k(&self, tc_k: f64) -> f64 {
        (self.capacity_j_k(tc_k + TC_STEP_K) / self.capacity_j_k(tc_k)).ln() / TC_STEP_K
    }

    /// Heat to the housing at `tc_k`, W: from bearing and turbine, and the rest. A row without temperature of the turbine housing or of the oil has no conduction to the bearing and no
    /// radiation.
    pub(crate) fn heats_w(&self, row: &Row, tc_k: f64, shared: &SharedVector) -> [f64; 2] {
        let ambient_k = if row.ambient_k.is_finite() { row.ambient_k } else { row.t1_k };
        let lost_w = external_heat_w(
            self.external_area_m2,
            self.emissivity_ratio,
            1.0 + shared[EXTERNAL],
            tc_k,
            ambient_k,
        );
        let other_w = shared[HEAT] + shared[HEAT_BY_TC] * (tc_k - MIDDLE_TC_K);
        if !row.has_neighbours() {
            return [0.0, other_w - lost_w];
        }
        let conductance_w_k = bearing_conductance_w_k(&self.bearing) * (1.0 + shared[BEARING]);
        let oil_w_k = self.bearing.oil_conductance_w_k * shared[LN_OIL].exp();
        let friction_w = friction_heat_w(&self.bearing, rad_s_of_rpm(row.speed_rpm));
        let node_k = bearing_k(conductance_w_k, oil_w_k, friction_w, tc_k, row.tt_k, row.oil_k);
        let turbine_w = radiation_w(shared[RADIATION], row.tt_k, tc_k);
        [conductance_w_k * (node_k - tc_k) + turbine_w, other_w - lost_w]
    }

    /// Derivatives of these heats.
    pub(crate) fn heat_slopes(&self, row: &Row, tc_k: f64, shared: &SharedVector) -> HeatSlopes {
        let here = self.heats_w(row, tc_k, shared);
        let quotient = |there: [f64; 2], step: f64| [0, 1].map(|k| (there[k] - here[k]) / step);
        std::array::from_fn(|place| match HEAT_PARAMETERS.get(place) {
            Some(index) => {
                let mut moved = *shared;
                moved[*index] += STEPS[place];
                quotient(self.heats_w(row, tc_k, &moved), STEPS[place])
            }
            None => quotient(self.heats_w(row, tc_k + TC_STEP_K, shared), TC_STEP_K),
        })
    }
}
