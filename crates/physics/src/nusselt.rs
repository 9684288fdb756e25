//! Forced convection inside the housings: the Sieder-Tate form of eq. 9 with Appendix A's coefficients.

use crate::air;

/// Exponent of the viscosity ratio bulk over wall.
pub const WALL_EXPONENT: f64 = 0.14;

/// Convective heat-transfer coefficient of pipe flow, W/(m2 K).
///
/// `Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14`, `Re = 4 m/(pi d mu)`; properties at `bulk_k`, `mu_skin` at `wall_k`
/// (Burke et al., eqs. 5 and 9; a and b from Appendix A). `flow_kg_s` > 0.
#[inline]
pub fn coefficient_w_m2k(
    coefficient: f64,
    exponent: f64,
    diameter_m: f64,
    flow_kg_s: f64,
    bulk_k: f64,
    wall_k: f64,
) -> f64 {
    let mu = air::viscosity_pa_s(bulk_k);
    let k = air::conductivity_w_mk(bulk_k);
    let reynolds = 4.0 * flow_kg_s / (std::f64::consts::PI * diameter_m * mu);
    let prandtl = air::heat_capacity_j_kgk(bulk_k) * mu / k;
    // Three powers as one exponential of a sum of logarithms: half the time, and this is the model's hottest line.
    let ln_shape = exponent * reynolds.ln()
        + prandtl.ln() / 3.0
        + WALL_EXPONENT * (mu / air::viscosity_pa_s(wall_k)).ln();
    let nusselt = coefficient * ln_shape.exp();
    nusselt * k / diameter_m
}
