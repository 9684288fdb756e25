//! Upper bound on the flow of any compressor, to detect wrong units.
//!
//! An inlet passes at most the flow of a choked pipe of the wheel's diameter, and the tip speed of a wheel is limited.
//! Together they limit the flow by the speed alone: 13 kg/s at 50 krpm, 1.5 kg/s at 150 krpm. Real machines reach at least a tenth of this.

use crate::gas::air;

/// Maximum tip speed of a wheel, m/s: forged titanium; series wheels reach 560 m/s.
pub const MAX_TIP_SPEED_M_S: f64 = 700.0;
/// Inlet temperature and pressure of the choked pipe: the SAE reference state.
const T_K: f64 = 298.0;
const P_PA: f64 = 100e3;
/// Minimum top speed of a turbocharger's map, rpm: the largest, on ship engines, reach about 9000 rpm.
pub const MIN_TOP_SPEED_RPM: f64 = 1000.0;
/// Maximum speed of any turbocharger, rpm: the smallest reach about 400 000 rpm.
pub const MAX_SPEED_RPM: f64 = 2e6;

/// Maximum corrected flow of any compressor at a corrected speed (rpm, > 0), kg/s.
pub fn max_flow_kg_s(speed_corrected_rpm: f64) -> f64 {
    let gamma = air::HEAT_CAPACITY_RATIO;
    // Choked mass flux, e.g. Shapiro, The Dynamics and Thermodynamics of Compressible Fluid Flow, eq. 4.18.
    let flux_kg_s_m2 = P_PA
        * (gamma / (air::GAS_CONSTANT_J_KGK * T_K)).sqrt()
        * (2.0 / (gamma + 1.0)).powf((gamma + 1.0) / (2.0 * (gamma - 1.0)));
    let diameter_m = 60.0 * MAX_TIP_SPEED_M_S / (std::f64::consts::PI * speed_corrected_rpm);
    flux_kg_s_m2 * 0.25 * std::f64::consts::PI * diameter_m * diameter_m
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0.0404 sqrt(K) s/m per unit of pressure: the textbook's figure for air.
    #[test]
    fn the_flux_is_that_of_the_textbook() {
        let diameter_m = 60.0 * MAX_TIP_SPEED_M_S / (std::f64::consts::PI * 50e3);
        let area_m2 = 0.25 * std::f64::consts::PI * diameter_m * diameter_m;
        let expected = 0.0404 * P_PA / T_K.sqrt() * area_m2;
        assert!((max_flow_kg_s(50e3) / expected - 1.0).abs() < 2e-3);
    }
}
