//! What the model needs of a compressor map, similarity laws, and the limit of flow at the inlet.

use crate::gas::air;
use mapper_core::ReferenceState;

/// Value of a map at one corrected speed and pressure ratio.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CharacteristicPoint {
    /// Corrected mass flow, kg/s. Negative far beyond the surge line of the closed form.
    pub flow_corrected_kg_s: f64,
    /// Isentropic efficiency, total to total, fraction.
    pub efficiency: f64,
    /// Position along the speed line: <= 0 choked, 1 on the surge line, > 1 beyond it.
    pub surge_position_ratio: f64,
}

/// A compressor map in corrected quantities, defined for every positive speed and every pressure ratio, so that an
/// integration cannot leave it; `surge_position_ratio` shows whether a point is in the measured part.
pub trait CompressorCharacteristic: Send + Sync + std::fmt::Debug {
    /// Reference state of the map's corrected quantities.
    fn reference(&self) -> ReferenceState;

    /// Flow, efficiency and position on the speed line. `speed_corrected_rpm` > 0.
    fn evaluate(&self, speed_corrected_rpm: f64, pressure_ratio: f64) -> CharacteristicPoint;

    /// The characteristic of a compressor with `flow_scale_ratio` times the flow: `m_corr = s m(N, PR)`, and its efficiency is
    /// that of the map at this flow, `eta(N, m_corr)`; the position on the speed line does not change. If a map has the efficiency
    /// as a function of pressure ratio only, the efficiency changes along the slope of the speed line, to first order.
    fn evaluate_scaled(
        &self,
        speed_corrected_rpm: f64,
        pressure_ratio: f64,
        flow_scale_ratio: f64,
    ) -> CharacteristicPoint {
        let point = self.evaluate(speed_corrected_rpm, pressure_ratio);
        if flow_scale_ratio == 1.0 {
            return point;
        }
        let flow_corrected_kg_s = flow_scale_ratio * point.flow_corrected_kg_s;
        // A central difference over a hundredth of the pressure rise to each side.
        let offset = 0.01 * (pressure_ratio - 1.0).abs().max(0.01);
        let [low, high] = [-offset, offset].map(|by| self.evaluate(speed_corrected_rpm, pressure_ratio + by));
        let difference_kg_s = high.flow_corrected_kg_s - low.flow_corrected_kg_s;
        let slope = if difference_kg_s.abs() > 1e-9 {
            (high.efficiency - low.efficiency) / difference_kg_s
        } else {
            0.0
        };
        let change = slope * (flow_corrected_kg_s - point.flow_corrected_kg_s);
        let efficiency = (point.efficiency + change).clamp(0.5 * point.efficiency, 1.5 * point.efficiency);
        CharacteristicPoint { flow_corrected_kg_s, efficiency, ..point }
    }

    /// End of the speed line on the surge side: corrected flow in kg/s and pressure ratio.
    fn surge_point(&self, speed_corrected_rpm: f64) -> (f64, f64);

    /// Largest corrected flow of the speed line, kg/s.
    fn choke_flow_corrected_kg_s(&self, speed_corrected_rpm: f64) -> f64;

    /// Text that distinguishes the map from any other; part of the hash of a plan.
    fn fingerprint(&self) -> String;
}

/// (gamma - 1)/gamma of cold air.
const KAPPA: f64 = 1.0 - 1.0 / crate::gas::air::HEAT_CAPACITY_RATIO;

/// Isentropic head over cp T1 of cold air, `PR^((gamma-1)/gamma) - 1`, ratio; `pressure_ratio` > 0.
pub fn head_ratio(pressure_ratio: f64) -> f64 {
    pressure_ratio.powf(KAPPA) - 1.0
}

/// Pressure ratio of a head ([`head_ratio`]); a negative head counts as 0.
pub fn pressure_ratio_of_head(head_ratio: f64) -> f64 {
    pressure_ratio_of_signed_head(head_ratio.max(0.0))
}

/// Pressure ratio of a head that may be negative (the machine brakes the gas); heads below -0.9 count as -0.9.
pub fn pressure_ratio_of_signed_head(head_ratio: f64) -> f64 {
    (1.0 + head_ratio.max(-0.9)).powf(1.0 / KAPPA)
}

/// Flow and pressure ratio of a point converted to `speed_factor` times its corrected speed; the efficiency stays.
pub fn at_speed(flow_corrected_kg_s: f64, pressure_ratio: f64, speed_factor: f64) -> (f64, f64) {
    let head = head_ratio(pressure_ratio) * speed_factor * speed_factor;
    (flow_corrected_kg_s * speed_factor, pressure_ratio_of_signed_head(head))
}

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

    #[test]
    fn head_is_the_text_book_value_and_turns_back() {
        // PR 2 at gamma 1.4: T2s/T1 = 2^(2/7) = 1.21901.
        assert!((head_ratio(2.0) - 0.219_014).abs() < 1e-6);
        for ratio in [0.6, 1.0, 1.3, 4.2] {
            assert!((pressure_ratio_of_signed_head(head_ratio(ratio)) - ratio).abs() < 1e-12);
        }
        let (flow, ratio) = at_speed(0.1, 2.0, 1.01);
        assert!((flow - 0.101).abs() < 1e-15);
        assert!((head_ratio(ratio) / head_ratio(2.0) - 1.0201).abs() < 1e-12);
    }

    /// 0.0404 sqrt(K) s/m per unit of pressure: the textbook's figure for air.
    #[test]
    fn the_flux_is_that_of_the_textbook() {
        let diameter_m = 60.0 * MAX_TIP_SPEED_M_S / (std::f64::consts::PI * 50e3);
        let area_m2 = 0.25 * std::f64::consts::PI * diameter_m * diameter_m;
        let expected = 0.0404 * P_PA / T_K.sqrt() * area_m2;
        assert!((max_flow_kg_s(50e3) / expected - 1.0).abs() < 2e-3);
    }
}
