//! Forced convection inside the housings: the Sieder-Tate form of eq. 9 with Appendix A's coefficients.
//!
//! The form is that of turbulent flow in a smooth pipe (Sieder and Tate, Ind. Eng. Chem. 28, 1936): a = 0.027, b = 0.8 for
//! Re > 1e4 and Pr 0.7 to 16 700. Appendix A fits a and b to the compressor and the turbine themselves; such a pair is valid
//! within the flows of its own measurements, Re of some 1e4 to 3e5 here. Properties of air: see [`air`].

use crate::gas::air;

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
    let ln_k_ratio = air::ln_conductivity_ratio(bulk_k);
    let reynolds = 4.0 * flow_kg_s / (std::f64::consts::PI * diameter_m * mu);
    // All powers in one exponential of a sum of logarithms: half the time of this formula, in which the model spends most of its time.
    let ln_prandtl =
        (air::heat_capacity_j_kgk(bulk_k) * mu / air::CONDUCTIVITY_AT_300_K_W_MK).ln() - ln_k_ratio;
    let ln_nusselt =
        exponent * reynolds.ln() + ln_prandtl / 3.0 + WALL_EXPONENT * (mu / air::viscosity_pa_s(wall_k)).ln();
    coefficient * (ln_nusselt + ln_k_ratio).exp() * air::CONDUCTIVITY_AT_300_K_W_MK / diameter_m
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sieder and Tate's own coefficients on air at 300 K with the properties of a table (Incropera, table A.4:
    /// mu = 184.6e-7 Pa s, k = 26.3e-3 W/(m K), Pr = 0.707): 0.05 kg/s in 35 mm is Re = 98 530 and Nu = 0.027 Re^0.8 Pr^(1/3)
    /// = 237.7, so h = 178.6 W/(m2 K). The closed forms of air contribute 2 % of it.
    #[test]
    fn pipe_flow_has_the_text_book_coefficient() {
        let h_w_m2k = coefficient_w_m2k(0.027, 0.8, 0.035, 0.05, 300.0, 300.0);
        assert!((h_w_m2k / 178.6 - 1.0).abs() < 0.02, "{h_w_m2k} W/(m2 K)");
    }

    /// A wall of 400 K makes the gas next to it more viscous: (184.6/230.1)^0.14 = 0.9696 by the same table.
    #[test]
    fn a_hot_wall_lowers_the_coefficient_as_the_viscosities_say() {
        let at_wall = |wall_k: f64| coefficient_w_m2k(0.027, 0.8, 0.035, 0.05, 300.0, wall_k);
        // Viscosities within 2 %, to the power of 0.14.
        assert!((at_wall(400.0) / at_wall(300.0) - 0.9696).abs() < 0.003);
    }

    /// Appendix A's compressor: twice the flow is 2^1.13 times the coefficient.
    #[test]
    fn flow_enters_with_the_exponent() {
        let at_flow = |flow_kg_s: f64| coefficient_w_m2k(0.004, 1.13, 0.035, flow_kg_s, 350.0, 330.0);
        assert!((at_flow(0.08) / at_flow(0.04) - 2f64.powf(1.13)).abs() < 1e-12);
    }
}
