//! The metal: conduction through the bearing housing, heat to the oil and to the cell, heat capacities.

use crate::params::{BearingParams, Params};

/// Stefan-Boltzmann constant, W/(m2 K4).
pub const STEFAN_BOLTZMANN_W_M2K4: f64 = 5.670_374_419e-8;

/// Free convection of a housing, `h_ext = 1.25 |T - T_amb|^(1/3)` (Appendix A): the 1.25, W/(m2 K^(4/3)).
const FREE_CONVECTION_COEFFICIENT: f64 = 1.25;

/// Half the bearing housing each way: conductance from a housing to the bearing node, W/K.
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
    // The library's cube root takes three times as long as this; 0 gives exp(-inf) = 0, as it must.
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
