//! The parts of the housing that have their own temperature, and their heat balances.
//!
//! The thermocouple is on the outer part. Another part p has its own share of the heat capacity and of the area that the gas touches, and
//! the second part a share of the heat from the bearing:
//!
//! ```text
//! phi_p C dT_p/dt = s_p (q + h A (Tw - T_p)) - G_p (T_p - Tc) + b_p Q_bearing,     Tw = sum of s T
//! ```
//!
//! with q the heat from the gas to a wall of the mean temperature Tw (eq. 3 with several walls in one gas). An inner wall is one part that
//! has all the area and no heat from elsewhere. A part is integrated through the whole run, jumps included, with the measured Tc: it
//! remembers the point before, and neither warms up nor cools down when the run begins.

use crate::joint::step_model::gas_path::{Inputs, Setting};
use crate::joint::step_model::parameters::{
    LN_INNER_CONDUCTANCE, LN_THIRD_CONDUCTANCE, LOGIT_AREA, LOGIT_BEARING, LOGIT_INNER, LOGIT_THIRD,
    LOGIT_THIRD_AREA, Place, SharedVector,
};

/// Number of parts besides the outer one at most. Source: [`Parts::Three`].
pub(crate) const OTHERS: usize = 2;
/// Exponent below which the mean over a row replaces the formula. Bound: the next term is below rounding.
const SERIES_BELOW: f64 = 1e-6;
/// Iterations to the temperatures of settled parts, and to changes of them. Bound: each reduces their distance, some 10 K, at least threefold.
pub(crate) const SETTLED_ROUNDS: usize = 8;
/// Step of the derivatives by the division's parameters. Bound: between rounding and curvature.
const DIVISION_STEP: f64 = 1e-4;

/// How the housing is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Parts {
    /// One temperature.
    One,
    /// An inner wall that alone touches the gas.
    InnerWall,
    /// A second part, and the gas touches both.
    Two,
    /// A second and a third part.
    Three,
}

impl Parts {
    /// Number of parts besides the outer one.
    pub(crate) fn others(self) -> usize {
        match self {
            Parts::One => 0,
            Parts::InnerWall | Parts::Two => 1,
            Parts::Three => 2,
        }
    }

    /// The parameters of the division.
    pub(crate) fn parameters(self) -> &'static [Place] {
        const ALL: [Place; 7] = [
            LOGIT_INNER,
            LN_INNER_CONDUCTANCE,
            LOGIT_AREA,
            LOGIT_BEARING,
            LOGIT_THIRD,
            LN_THIRD_CONDUCTANCE,
            LOGIT_THIRD_AREA,
        ];
        let count = match self {
            Parts::One => 0,
            Parts::InnerWall => 2,
            Parts::Two => 4,
            Parts::Three => 7,
        };
        &ALL[..count]
    }
}

/// Shares of each part, the outer one first, and conductances of the others to it; or changes of them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Division {
    /// Number of parts besides the outer one.
    pub(crate) others: usize,
    /// Shares of the heat capacity.
    pub(crate) capacity: [f64; OTHERS + 1],
    /// Shares of the area that the gas touches.
    pub(crate) area: [f64; OTHERS + 1],
    /// Conductances to the outer part, W/K.
    pub(crate) conductance_w_k: [f64; OTHERS],
    /// Shares of the others in the heat from the bearing.
    pub(crate) bearing: [f64; OTHERS],
}

fn share_of(logit: f64) -> f64 {
    1.0 / (1.0 + (-logit).exp())
}

impl Division {
    pub(crate) fn of(parts: Parts, shared: &SharedVector) -> Self {
        let one = Division { capacity: [1.0, 0.0, 0.0], area: [1.0, 0.0, 0.0], ..Division::default() };
        let (inner, inner_w_k) = (share_of(shared[LOGIT_INNER]), shared[LN_INNER_CONDUCTANCE].exp());
        match parts {
            Parts::One => one,
            Parts::InnerWall => Division {
                others: 1,
                capacity: [1.0 - inner, inner, 0.0],
                area: [0.0, 1.0, 0.0],
                conductance_w_k: [inner_w_k, 0.0],
                ..one
            },
            Parts::Two | Parts::Three => {
                let [area, bearing] = [LOGIT_AREA, LOGIT_BEARING].map(|index| share_of(shared[index]));
                let [third, third_area] = match parts {
                    Parts::Three => [LOGIT_THIRD, LOGIT_THIRD_AREA].map(|index| share_of(shared[index])),
                    _ => [0.0; 2],
                };
                let outer = 1.0 - inner;
                let touched = 1.0 - area;
                Division {
                    others: parts.others(),
                    capacity: [outer * (1.0 - third), inner, outer * third],
                    area: [area, touched * (1.0 - third_area), touched * third_area],
                    conductance_w_k: [inner_w_k, shared[LN_THIRD_CONDUCTANCE].exp()],
                    bearing: [bearing, 0.0],
                }
            }
        }
    }

    /// Derivative by a parameter.
    pub(crate) fn slope(parts: Parts, shared: &SharedVector, index: Place) -> Self {
        let at = |by: f64| {
            let mut moved = *shared;
            moved[index] += by;
            Division::of(parts, &moved)
        };
        let (low, high) = (at(-DIVISION_STEP), at(DIVISION_STEP));
        let slope = |low: f64, high: f64| (high - low) / (2.0 * DIVISION_STEP);
        Division {
            others: high.others,
            capacity: std::array::from_fn(|i| slope(low.capacity[i], high.capacity[i])),
            area: std::array::from_fn(|i| slope(low.area[i], high.area[i])),
            conductance_w_k: std::array::from_fn(|p| slope(low.conductance_w_k[p], high.conductance_w_k[p])),
            bearing: std::array::from_fn(|p| slope(low.bearing[p], high.bearing[p])),
        }
    }

    /// Mean temperature of the wall that the gas touches, K.
    pub(crate) fn wall_k(&self, outer_k: f64, others_k: &[f64; OTHERS]) -> f64 {
        self.area[0] * outer_k + self.area[1] * others_k[0] + self.area[2] * others_k[1]
    }
}

/// The other parts along a row.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PartsRow {
    /// Mean temperatures, K.
    pub(crate) mean_k: [f64; OTHERS],
    /// Share of each deviation that is left at the row's end.
    pub(crate) kept: [f64; OTHERS],
    /// Mean share over the row.
    pub(crate) mean: [f64; OTHERS],
    /// Conductance of each to gas and outer part, W/K.
    pub(crate) sum_w_k: [f64; OTHERS],
    /// Mean rate of each times its capacity, W.
    pub(crate) stored_w: [f64; OTHERS],
}

/// What acts on the parts in a row.
#[derive(Clone, Copy)]
pub(crate) struct Around<'a> {
    pub(crate) setting: &'a Setting,
    pub(crate) shared: &'a SharedVector,
    pub(crate) division: &'a Division,
    pub(crate) inputs: Inputs,
    /// Heat from bearing and turbine, W.
    pub(crate) bearing_w: f64,
}

impl Around<'_> {
    /// Heat to each other part, W, and what it falls by per kelvin of that part, W/K.
    fn heats(&self, others_k: &[f64; OTHERS]) -> [(f64, f64); OTHERS] {
        let Around { division, inputs, .. } = self;
        let wall_k = division.wall_k(inputs.outer_k, others_k);
        let (wall_w, gas_w_k, contact_w_k) =
            self.setting.wall_heat(&Inputs { wall_k, ..*inputs }, self.shared);
        std::array::from_fn(|p| {
            let (area, conductance_w_k) = (division.area[p + 1], division.conductance_w_k[p]);
            let from_gas_w = area * (wall_w + contact_w_k * (wall_k - others_k[p]));
            let heat_w = from_gas_w - conductance_w_k * (others_k[p] - inputs.outer_k)
                + division.bearing[p] * self.bearing_w;
            (heat_w, area * (area * gas_w_k + (1.0 - area) * contact_w_k) + conductance_w_k)
        })
    }

    /// The parts that neither warm up nor cool down, K: what a run begins with.
    pub(crate) fn settled_k(&self) -> [f64; OTHERS] {
        let mut others_k = [self.inputs.outer_k; OTHERS];
        for _ in 0..SETTLED_ROUNDS {
            for part in 0..self.division.others {
                let (heat_w, sum_w_k) = self.heats(&others_k)[part];
                others_k[part] += heat_w / sum_w_k;
            }
        }
        others_k
    }

    /// The parts over a row with constant coefficients, from their temperatures at its begin: those at its end, and the row.
    pub(crate) fn along(
        &self,
        start_k: [f64; OTHERS],
        capacity_j_k: f64,
        width_s: f64,
    ) -> ([f64; OTHERS], PartsRow) {
        let mut end_k = [self.inputs.outer_k; OTHERS];
        let mut row = PartsRow { mean_k: end_k, ..PartsRow::default() };
        if self.division.others == 0 {
            return (end_k, row);
        }
        let heats = self.heats(&start_k);
        for part in 0..self.division.others {
            let (heat_w, sum_w_k) = heats[part];
            let part_j_k = self.division.capacity[part + 1] * capacity_j_k;
            let settled_k = start_k[part] + heat_w / sum_w_k;
            let x = width_s * sum_w_k / part_j_k;
            let (kept, mean) = ((-x).exp(), mean_decay(x));
            let away_k = start_k[part] - settled_k;
            end_k[part] = settled_k + away_k * kept;
            row.mean_k[part] = settled_k + away_k * mean;
            (row.kept[part], row.mean[part], row.sum_w_k[part]) = (kept, mean, sum_w_k);
            row.stored_w[part] =
                if width_s > 0.0 { part_j_k * (end_k[part] - start_k[part]) / width_s } else { 0.0 };
        }
        (end_k, row)
    }
}

/// Mean of `exp(-x s)` over s from 0 to 1.
fn mean_decay(x: f64) -> f64 {
    if x.abs() < SERIES_BELOW { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::IdentifyConfig;
    use crate::joint::step_model::parameters::{EXPONENT, LN_COEFFICIENT, SHARED};
    use mapper_physics::rig::sensor_fault::ExactReadings;

    /// Whatever the division, the parts take what the gas gives: at rest no part stores heat, so the gas heat, the bearing's share and what
    /// flows to the outer part add up. Rounding, and the end of the iteration.
    #[test]
    fn settled_parts_pass_on_the_heat_of_gas_and_bearing() {
        let config = IdentifyConfig::default();
        let exact_at = ExactReadings { pressure_pa: 100e3, temperature_k: 297.0 };
        let setting = Setting { exact_at, ..Setting::of(&config, 1.3e5) };
        let mut shared = [0.0; SHARED];
        shared[LN_COEFFICIENT] = 0.004_f64.ln() + 1.13 * 1.3e5_f64.ln();
        shared[EXPONENT] = 1.13;
        for (parameter, value) in
            Parts::Three.parameters().iter().zip([-0.5, 3.0, -0.3, 0.5, -1.0, 2.0, -0.7])
        {
            shared[*parameter] = value;
        }
        let inputs = Inputs {
            t1_k: 297.0,
            wall_k: 340.0,
            outer_k: 340.0,
            p1_pa: 99e3,
            p2_pa: 220e3,
            flow_kg_s: 0.06,
            eta: 0.7,
            ln_h: 0.0,
            alpha_area_ratio: 0.0,
            ln_heating_cooling_ratio: 0.0,
            preheat_w_k: 0.0,
            inlet_power: 0.0,
            humidity_kg_kg: 0.0,
        };
        for parts in [Parts::InnerWall, Parts::Two, Parts::Three] {
            let division = Division::of(parts, &shared);
            for shares in [division.capacity, division.area] {
                assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{parts:?}");
            }
            let around =
                Around { setting: &setting, shared: &shared, division: &division, inputs, bearing_w: 50.0 };
            let settled_k = around.settled_k();
            let wall_k = division.wall_k(inputs.outer_k, &settled_k);
            let (gas_w, _, contact_w_k) = setting.wall_heat(&Inputs { wall_k, ..inputs }, &shared);
            let to_outer_w = division.area[0] * (gas_w + contact_w_k * (wall_k - inputs.outer_k));
            let passed_w: f64 = (0..division.others)
                .map(|p| {
                    division.conductance_w_k[p] * (settled_k[p] - inputs.outer_k) - division.bearing[p] * 50.0
                })
                .sum();
            assert!(
                (gas_w - to_outer_w - passed_w).abs() < 1e-3 * gas_w.abs(),
                "{parts:?}: {gas_w} {to_outer_w} {passed_w}"
            );
            // Over a long row they stay there.
            let (end_k, row) = around.along(settled_k, 900.0, 100.0);
            for p in 0..division.others {
                assert!((end_k[p] - settled_k[p]).abs() < 1e-2 && row.stored_w[p].abs() < 0.1, "{parts:?}");
            }
        }
    }
}
