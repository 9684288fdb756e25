//! Heat transfer of the housings: conduction through the bearing housing, heat to the oil and to the cell, heat capacities.
//!
//! Each housing has one temperature: its Biot number is below 0.1 with the coefficients of the paper. Free convection is that of
//! Appendix A: turbulent over a body of some 0.1 m, with walls at least 10 K above the cell. Heat capacities are straight lines
//! over the ranges of Appendix A and are extrapolated beyond them.

use crate::machine::params::{BearingParams, Params};

/// Stefan-Boltzmann constant, W/(m2 K4).
pub const STEFAN_BOLTZMANN_W_M2K4: f64 = 5.670_374_419e-8;

/// Coefficient of free convection of a housing, `h_ext = 1.25 |T - T_amb|^(1/3)` (Appendix A), W/(m2 K^(4/3)).
const FREE_CONVECTION_COEFFICIENT: f64 = 1.25;

/// Conductance from a housing to the bearing node, through half of the bearing housing, W/K.
pub fn bearing_conductance_w_k(bearing: &BearingParams) -> f64 {
    2.0 * bearing.conductivity_w_mk * bearing.section_area_m2 / bearing.length_m
}

/// Temperature of the massless bearing node between both housings and the oil, K.
#[inline]
pub fn bearing_k(
    bearing_conductance_w_k: f64,
    oil_conductance_w_k: f64,
    tc_k: f64,
    tt_k: f64,
    oil_k: f64,
) -> f64 {
    (bearing_conductance_w_k * (tt_k + tc_k) + oil_conductance_w_k * oil_k)
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
    params.compressor.housing_mass_kg * (930.0 + 60.0 * (tc_k - 300.0) / 200.0)
}

/// Heat capacity of the turbine housing, J/K (Appendix A: 500-700 J/(kg K) over 300..800 K).
#[inline]
pub fn turbine_capacity_j_k(params: &Params, tt_k: f64) -> f64 {
    params.turbine.housing_mass_kg * (500.0 + 200.0 * (tt_k - 300.0) / 500.0)
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
        assert!((bearing_k(1.5, 0.0, 340.0, 500.0, 320.0) - 420.0).abs() < 1e-12);
        assert!((bearing_k(1.5, 1.5, 340.0, 500.0, 330.0) - 390.0).abs() < 1e-12);
        assert!((compressor_capacity_j_k(&params, 300.0) - 0.93 * 930.0).abs() < 1e-9);
        assert!((turbine_capacity_j_k(&params, 800.0) - 3.15 * 700.0).abs() < 1e-9);
    }
}
