//! The heat that the compressor housing exchanges with everything but the gas.
//!
//! `Q = G_b (T_b(Tt, Tc, T_oil) - Tc) - free convection - radiation to the cell + F A sigma (Tt^4 - Tc^4) + c0 + c1 (Tc - 330 K)`, by
//! Appendix A of the paper, with a relative error of each part. `c0` and `c1` are heat from another source: constant, and in proportion to
//! Tc, as a coolant. Without the temperatures of turbine housing and oil they also stand for bearing and turbine.

use crate::config::Housing;
use crate::joint::step_model::parameters::{
    BEARING, EXTERNAL, HEAT, HEAT_BY_TC, LN_OIL, RADIATION, SharedVector,
};
use crate::joint::step_model::rows::Row;
use mapper_physics::laws::housing::{
    bearing_conductance_w_k, bearing_k, capacity_j_k, external_heat_w, radiation_w,
};

/// Housing temperature from which heat in proportion to it counts, K. Bound: the middle of a warm compressor; another one moves the
/// constant part.
const MIDDLE_TC_K: f64 = 330.0;
/// Step of the derivative by Tc, K. Bound: between rounding and curvature.
const TC_STEP_K: f64 = 1e-2;
/// Parameters of the heat.
pub(crate) const HEAT_PARAMETERS: [usize; 6] = [EXTERNAL, BEARING, LN_OIL, RADIATION, HEAT, HEAT_BY_TC];
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

    /// Heat to the housing at `tc_k`, W. A row without temperature of the turbine housing or of the oil has no conduction to the bearing and no
    /// radiation.
    pub(crate) fn heat_w(&self, row: &Row, tc_k: f64, shared: &SharedVector) -> f64 {
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
            return other_w - lost_w;
        }
        let conductance_w_k = bearing_conductance_w_k(&self.bearing) * (1.0 + shared[BEARING]);
        let oil_w_k = self.bearing.oil_conductance_w_k * shared[LN_OIL].exp();
        let node_k = bearing_k(conductance_w_k, oil_w_k, tc_k, row.tt_k, row.oil_k);
        conductance_w_k * (node_k - tc_k) + radiation_w(shared[RADIATION], row.tt_k, tc_k) + other_w - lost_w
    }

    /// Derivatives of that heat by [`HEAT_PARAMETERS`] and, last, by Tc.
    pub(crate) fn heat_slopes(&self, row: &Row, tc_k: f64, shared: &SharedVector) -> [f64; 7] {
        let here = self.heat_w(row, tc_k, shared);
        std::array::from_fn(|place| match HEAT_PARAMETERS.get(place) {
            Some(index) => {
                let mut moved = *shared;
                moved[*index] += STEPS[place];
                (self.heat_w(row, tc_k, &moved) - here) / STEPS[place]
            }
            None => (self.heat_w(row, tc_k + TC_STEP_K, shared) - here) / TC_STEP_K,
        })
    }
}
