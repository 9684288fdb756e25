//! Heat balances of the housings, in operation and at rest.

use crate::laws::housing;
use crate::machine::params::{BearingParams, FRICTION_SPEED_RPM, Params, rad_s_of_rpm};

/// Stefan-Boltzmann constant, W/(m2 K4).
pub const STEFAN_BOLTZMANN_W_M2K4: f64 = 5.670_374_419e-8;

/// Coefficient of free convection of a housing, `h_ext = 1.25 |T - T_amb|^(1/3)` (Appendix A), W/(m2 K^(4/3)).
const FREE_CONVECTION_COEFFICIENT: f64 = 1.25;

/// Conductance from a housing to the bearing node, through half of the bearing housing, W/K.
pub fn bearing_conductance_w_k(bearing: &BearingParams) -> f64 {
    2.0 * bearing.conductivity_w_mk * bearing.section_area_m2 / bearing.length_m
}

/// Heat of viscous friction (Petroff) to the bearing housing, W.
#[inline]
pub fn friction_heat_w(bearing: &BearingParams, shaft_speed_rad_s: f64) -> f64 {
    bearing.friction_heat_w * (shaft_speed_rad_s / rad_s_of_rpm(FRICTION_SPEED_RPM)).powi(2)
}

/// Temperature of the massless bearing node between both housings and the oil, with the heat of friction, K.
#[inline]
pub fn bearing_k(
    bearing_conductance_w_k: f64,
    oil_conductance_w_k: f64,
    friction_w: f64,
    tc_k: f64,
    tt_k: f64,
    oil_k: f64,
) -> f64 {
    (bearing_conductance_w_k * (tt_k + tc_k) + oil_conductance_w_k * oil_k + friction_w)
        / (2.0 * bearing_conductance_w_k + oil_conductance_w_k)
}

/// Heat from a housing to the cell by free convection and radiation (Appendix A), W. `convection_ratio` multiplies the
/// convection; 1 is Appendix A's.
#[inline]
pub fn external_heat_w(
    area_m2: f64,
    emissivity_ratio: f64,
    convection_ratio: f64,
    wall_k: f64,
    ambient_k: f64,
) -> f64 {
    let over_k = wall_k - ambient_k;
    // The library function `cbrt` takes three times as long; 0 gives exp(-inf) = 0, as required.
    let third_root = (over_k.abs().ln() / 3.0).exp();
    let (wall2, ambient2) = (wall_k * wall_k, ambient_k * ambient_k);
    area_m2
        * (convection_ratio * FREE_CONVECTION_COEFFICIENT * third_root * over_k
            + emissivity_ratio * STEFAN_BOLTZMANN_W_M2K4 * (wall2 * wall2 - ambient2 * ambient2))
}

/// Heat from turbine to compressor housing by radiation through a view factor times area, W.
#[inline]
pub fn radiation_w(area_m2: f64, tt_k: f64, tc_k: f64) -> f64 {
    let (tt2, tc2) = (tt_k * tt_k, tc_k * tc_k);
    area_m2 * STEFAN_BOLTZMANN_W_M2K4 * (tt2 * tt2 - tc2 * tc2)
}

/// Heat capacity of the compressor housing, J/K (Appendix A: 930-990 J/(kg K) over 300..500 K).
#[inline]
pub fn compressor_capacity_j_k(params: &Params, tc_k: f64) -> f64 {
    capacity_j_k(params.compressor.housing_mass_kg, tc_k)
}

/// Heat capacity of a compressor housing of this mass, J/K.
#[inline]
pub fn capacity_j_k(mass_kg: f64, tc_k: f64) -> f64 {
    mass_kg * (930.0 + 60.0 * (tc_k - 300.0) / 200.0)
}

/// Heat capacity of the turbine housing, J/K (Appendix A: 500-700 J/(kg K) over 300..800 K).
#[inline]
pub fn turbine_capacity_j_k(params: &Params, tt_k: f64) -> f64 {
    turbine_capacity_of_mass_j_k(params.turbine.housing_mass_kg, tt_k)
}

/// Heat capacity of a turbine housing of this mass, J/K.
#[inline]
pub fn turbine_capacity_of_mass_j_k(mass_kg: f64, tt_k: f64) -> f64 {
    mass_kg * (500.0 + 200.0 * (tt_k - 300.0) / 500.0)
}

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
    let bearing_k =
        housing::bearing_k(bearing_w_k, params.bearing.oil_conductance_w_k, 0.0, tc_k, tt_k, oil_k);
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

    /// A black body at 300 K emits 459.3 W/m2 (sigma T^4, any text); 1.25 dT^(1/3) at 8 K is 2.5 W/(m2 K).
    #[test]
    fn radiation_and_free_convection_by_hand() {
        let radiated_w = external_heat_w(1.0, 1.0, 0.0, 300.0, 0.0);
        assert!((radiated_w - 459.3).abs() < 0.05, "{radiated_w} W");
        assert!((external_heat_w(2.0, 0.0, 1.0, 308.0, 300.0) - 2.0 * 2.5 * 8.0).abs() < 1e-9);
        assert!((external_heat_w(2.0, 0.0, 1.0, 292.0, 300.0) + 2.0 * 2.5 * 8.0).abs() < 1e-9);
        assert_eq!(external_heat_w(1.0, 1.0, 1.0, 300.0, 300.0), 0.0);
        // Incropera, 13.2: two large plates at 800 K and 500 K exchange sigma (T1^4 - T2^4) = 19 682 W/m2 as black bodies.
        assert!((radiation_w(1.0, 800.0, 500.0) / 19_682.0 - 1.0).abs() < 1e-4);
    }

    /// Appendix A: 2 k A/L = 2 47.5 7e-4/45e-3 = 1.4778 W/K; the node of equal conductances lies in the middle.
    #[test]
    fn the_bearing_housing_is_a_chain_of_conductances() {
        let params = Params::default();
        assert!((bearing_conductance_w_k(&params.bearing) - 1.4778).abs() < 1e-4);
        assert!((bearing_k(1.5, 0.0, 0.0, 340.0, 500.0, 320.0) - 420.0).abs() < 1e-12);
        assert!((bearing_k(1.5, 1.5, 0.0, 340.0, 500.0, 330.0) - 390.0).abs() < 1e-12);
        // 180 W at 100 krpm are 45 W at half the speed: 10 K through 4.5 W/K.
        let bearing = BearingParams { friction_heat_w: 180.0, ..params.bearing };
        let friction_w = friction_heat_w(&bearing, rad_s_of_rpm(50e3));
        assert!((bearing_k(1.5, 1.5, friction_w, 340.0, 500.0, 330.0) - 400.0).abs() < 1e-9);
        assert!((compressor_capacity_j_k(&params, 300.0) - 0.93 * 930.0).abs() < 1e-9);
        assert!((turbine_capacity_j_k(&params, 800.0) - 3.15 * 700.0).abs() < 1e-9);
    }

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
