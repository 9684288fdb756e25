//! Convection inside the housings: the Nusselt correlation, and the share of the compressor's area before the wheel.

use crate::gas::air;
use crate::machine::params::CompressorParams;
use mapper_core::InletConvection;

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

/// Machine data that determine the ratio of the inlet's heat transfer coefficient to the outlet's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InletLaw {
    /// Exponent b of the Reynolds number.
    pub exponent: f64,
    /// Diameter of the inlet pipe, m, > 0.
    pub inlet_diameter_m: f64,
    /// Diameter of the outlet pipe, m, > 0.
    pub outlet_diameter_m: f64,
}

impl InletLaw {
    /// h before the wheel over h after it.
    ///
    /// `Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14` (eq. 9, Appendix A) on either side: before the wheel Re with the inlet's
    /// diameter and properties at T1, after it with the outlet's and at `bulk_k`. Flow, wall and coefficient are the same
    /// on both sides and drop out. Temperatures 200 to 800 K.
    #[inline]
    pub fn h_ratio(&self, t1_k: f64, bulk_k: f64) -> f64 {
        let at = |diameter_m, gas_k| coefficient_w_m2k(1.0, self.exponent, diameter_m, 1.0, gas_k, t1_k);
        at(self.inlet_diameter_m, t1_k) / at(self.outlet_diameter_m, bulk_k)
    }
}

/// h before the wheel over h after it for this machine: 1 if both are shared.
#[inline]
pub(crate) fn h_ratio(compressor: &CompressorParams, t1_k: f64, bulk_k: f64) -> f64 {
    compressor.inlet_h_ratio
        * match compressor.inlet_convection {
            InletConvection::Shared => 1.0,
            InletConvection::Own => InletLaw {
                exponent: compressor.nusselt_exponent,
                inlet_diameter_m: compressor.inlet_diameter_m,
                outlet_diameter_m: compressor.outlet_diameter_m,
            }
            .h_ratio(t1_k, bulk_k),
        }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::params::Params;

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

    /// Air by a table (Incropera, table A.4: at 300 K mu = 184.6e-7 Pa s, k = 26.3e-3 W/(m K), Pr = 0.707; at 400 K
    /// 230.1e-7, 33.8e-3, 0.690), 0.05 kg/s, the housing at 350 K (208.2e-7). Before the wheel in 40 mm Re = 86 216 and Nu =
    /// 0.004 Re^1.13 Pr^(1/3) (184.6/208.2)^0.14 = 1324, so h = 870.3 W/(m2 K); behind it in 35 mm Re = 79 049, Nu = 1228 and
    /// h = 1185.5. The closed forms of air contribute 1 % of the ratio.
    #[test]
    fn before_the_wheel_the_law_has_the_inlet_s_diameter_and_gas() {
        let law = InletLaw { exponent: 1.13, inlet_diameter_m: 0.040, outlet_diameter_m: 0.035 };
        assert!((law.h_ratio(300.0, 400.0) / (870.3 / 1185.5) - 1.0).abs() < 0.01);
        let before = coefficient_w_m2k(0.004, 1.13, 0.040, 0.05, 300.0, 350.0);
        assert!((before / 870.3 - 1.0).abs() < 0.02, "{before} W/(m2 K)");
    }

    /// In the same pipe with the same gas there is one coefficient; without heat in the gas only the diameters matter.
    #[test]
    fn equal_pipes_share_their_coefficient() {
        let law = |inlet_diameter_m| InletLaw { exponent: 0.8, inlet_diameter_m, outlet_diameter_m: 0.035 };
        assert_eq!(law(0.035).h_ratio(310.0, 310.0), 1.0);
        // Nu/d with Re^0.8 on 1/d: d^-1.8.
        assert!((law(0.05).h_ratio(310.0, 310.0) - (0.035f64 / 0.05).powf(1.8)).abs() < 1e-12);
    }

    #[test]
    fn the_nominal_machine_shares_one_coefficient() {
        let mut compressor = Params::default().compressor;
        assert_eq!(h_ratio(&compressor, 298.0, 400.0), 1.0);
        compressor.inlet_convection = InletConvection::Own;
        assert!(h_ratio(&compressor, 298.0, 400.0) < 0.8);
    }
}
