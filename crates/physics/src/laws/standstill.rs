//! The machine at rest: no flow, both housings relax to the cell through the bearing housing.
//!
//! The running model is singular at speed 0 and flow 0; this model replaces it for soaks and zeros. Domain: no gas flow
//! at all; the heat balances are those of [`housing`] without their gas side.

use crate::laws::housing;
use crate::machine::params::Params;

/// Housing temperatures at standstill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StandstillState {
    /// Compressor housing, K.
    pub tc_k: f64,
    /// Turbine housing, K.
    pub tt_k: f64,
}

/// Maximum step of the integration, s: a hundredth of the time constants of the housings, which are minutes.
const MAX_STEP_S: f64 = 1.0;

/// Housing temperatures `duration_s` later.
///
/// Classical Runge-Kutta of order 4 with steps of at most 1 s: the system is not stiff.
pub fn relax(
    params: &Params,
    state: StandstillState,
    oil_k: f64,
    ambient_k: f64,
    duration_s: f64,
) -> StandstillState {
    let steps = (duration_s / MAX_STEP_S).ceil().max(1.0);
    let dt_s = duration_s / steps;
    let rates = |[tc_k, tt_k]: [f64; 2]| rates_k_s(params, tc_k, tt_k, oil_k, ambient_k);
    let moved = |y: [f64; 2], k: [f64; 2], share: f64| [y[0] + share * k[0], y[1] + share * k[1]];
    let mut y = [state.tc_k, state.tt_k];
    for _ in 0..steps as u64 {
        let k1 = rates(y);
        let k2 = rates(moved(y, k1, 0.5 * dt_s));
        let k3 = rates(moved(y, k2, 0.5 * dt_s));
        let k4 = rates(moved(y, k3, dt_s));
        y = std::array::from_fn(|i| y[i] + dt_s / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    StandstillState { tc_k: y[0], tt_k: y[1] }
}

fn rates_k_s(params: &Params, tc_k: f64, tt_k: f64, oil_k: f64, ambient_k: f64) -> [f64; 2] {
    let (compressor, turbine) = (&params.compressor, &params.turbine);
    let bearing_w_k = housing::bearing_conductance_w_k(&params.bearing);
    let bearing_k = housing::bearing_k(bearing_w_k, params.bearing.oil_conductance_w_k, tc_k, tt_k, oil_k);
    let external_w = |area_m2, emissivity_ratio, wall_k| {
        let convection_ratio = params.external_convection_ratio;
        housing::external_heat_w(area_m2, emissivity_ratio, convection_ratio, wall_k, ambient_k)
    };
    let radiation_w = housing::radiation_w(params.radiation_area_m2, tt_k, tc_k);
    let compressor_w = bearing_w_k * (bearing_k - tc_k) + radiation_w
        - external_w(compressor.external_area_m2, compressor.emissivity_ratio, tc_k);
    let turbine_w = bearing_w_k * (bearing_k - tt_k)
        - radiation_w
        - external_w(turbine.external_area_m2, turbine.emissivity_ratio, tt_k);
    [
        compressor_w / housing::compressor_capacity_j_k(params, tc_k),
        turbine_w / housing::turbine_capacity_j_k(params, tt_k),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lumped capacitance (Incropera, 5.1): without losses to the cell, and with oil that fixes the bearing node, a housing falls
    /// to 1/e of its excess in M c/G. The oil's conductance is made large; c at 300 K, and nearly so 1 K above it.
    #[test]
    fn a_housing_cools_as_a_lumped_capacitance() {
        let mut params = Params { external_convection_ratio: 0.0, ..Params::default() };
        params.compressor.emissivity_ratio = 0.0;
        params.bearing.oil_conductance_w_k = 1e9;
        let tau_s =
            params.compressor.housing_mass_kg * 930.0 / housing::bearing_conductance_w_k(&params.bearing);
        let state = StandstillState { tc_k: 301.0, tt_k: 300.0 };
        let later = relax(&params, state, 300.0, 300.0, tau_s);
        // c rises by 0.03 % per kelvin.
        assert!((later.tc_k - 300.0 - 1.0 / std::f64::consts::E).abs() < 2e-4, "{} K", later.tc_k);
    }

    #[test]
    fn hot_housings_cool_monotonically_to_a_cell_at_one_temperature() {
        let params = Params::default();
        let mut state = StandstillState { tc_k: 360.0, tt_k: 480.0 };
        for _ in 0..40 {
            let next = relax(&params, state, 298.15, 298.15, 600.0);
            assert!(next.tt_k <= state.tt_k && next.tt_k >= 298.15 - 1e-9);
            state = next;
        }
        assert!((state.tc_k - 298.15).abs() < 0.05 && (state.tt_k - 298.15).abs() < 0.05, "{state:?}");
    }
}
