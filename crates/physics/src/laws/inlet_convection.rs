//! Convection before the compressor's wheel: the Nusselt law of the outlet at the inlet's own diameter and gas.
//!
//! Eqs. 1 and 3 of Burke et al. have one h; their section 5.2 states that this "is not correct", and Appendix A gives the
//! inlet a diameter of its own. Coefficient and exponent of the law are those of the outlet: the inlet's own have not been measured.

use crate::laws::nusselt::coefficient_w_m2k;
use crate::machine::params::CompressorParams;
use mapper_core::InletConvection;

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
