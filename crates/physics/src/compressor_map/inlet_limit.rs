//! Upper bound on the flow of any compressor, to detect wrong units.
//!
//! An inlet passes at most the flow of a choked pipe of the wheel's diameter, and the tip speed of a wheel is limited.
//! Both together bound the flow by the speed alone: 13 kg/s at 50 krpm, 1.5 kg/s at 150 krpm. Real machines pass a tenth of
//! it and more.

use crate::gas::air;

/// Fastest tip of a wheel, m/s: forged titanium; series wheels turn at 560.
const TIP_M_S: f64 = 700.0;
/// State at which the pipe chokes: a reference state's temperature and pressure (SAE).
const T_K: f64 = 298.0;
const P_PA: f64 = 100e3;
/// Lowest top speed of a turbocharger's map, rpm: the largest, on ships' engines, turn at some 9000.
pub const SLOWEST_TOP_SPEED_RPM: f64 = 1000.0;
/// Highest speed of any turbocharger, rpm: the smallest ones reach some 400 000.
pub const FASTEST_SPEED_RPM: f64 = 2e6;

/// Largest corrected flow that any compressor passes at a corrected speed (rpm, > 0), kg/s.
pub fn largest_flow_kg_s(speed_corrected_rpm: f64) -> f64 {
    let gamma = air::HEAT_CAPACITY_RATIO;
    // Choked mass flux, e.g. Shapiro, The Dynamics and Thermodynamics of Compressible Fluid Flow, eq. 4.18.
    let flux_kg_s_m2 = P_PA
        * (gamma / (air::GAS_CONSTANT_J_KGK * T_K)).sqrt()
        * (2.0 / (gamma + 1.0)).powf((gamma + 1.0) / (2.0 * (gamma - 1.0)));
    let diameter_m = 60.0 * TIP_M_S / (std::f64::consts::PI * speed_corrected_rpm);
    flux_kg_s_m2 * 0.25 * std::f64::consts::PI * diameter_m * diameter_m
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0.0404 sqrt(K) s/m per unit of pressure: the textbook's figure for air.
    #[test]
    fn the_flux_is_that_of_the_textbook() {
        let diameter_m = 60.0 * TIP_M_S / (std::f64::consts::PI * 50e3);
        let area_m2 = 0.25 * std::f64::consts::PI * diameter_m * diameter_m;
        let expected = 0.0404 * P_PA / T_K.sqrt() * area_m2;
        assert!((largest_flow_kg_s(50e3) / expected - 1.0).abs() < 2e-3);
    }
}
