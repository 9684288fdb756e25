//! The closed-form map, with the characteristic of a compressor.
//!
//! The paper does not print its map tables; these formulas replace them. A speed line is part of an ellipse-like curve between a
//! zero-slope and a choke point, and the efficiency is a parabola over flow. They were fitted by eye to the ranges plotted in the paper, 50
//! to 170 krpm corrected to SAE's reference state, and continue smoothly outside these ranges.
//! Compressors with another wheel are geometrically similar: equal tip speed gives equal pressure ratio and efficiency, and a flow in
//! proportion to the square of the wheel (e.g. Dixon and Hall, Fluid Mechanics and Thermodynamics of Turbomachinery, ch. 2).

use crate::gas::air;
use crate::gas::air::power;
use mapper_core::ReferenceState;

/// Wheel exit diameter of turbo_a, m (Burke et al., Appendix A).
pub const TURBO_A_WHEEL_M: f64 = 52e-3;

/// Closed-form map of turbo_a, or of a compressor similar to it.
#[derive(Debug, Clone, Copy)]
pub struct ClosedFormMap {
    /// Wheel exit diameter, m.
    pub wheel_diameter_m: f64,
}

struct SpeedLineEnds {
    zero_slope_pressure_ratio: f64,
    zero_slope_flow_kg_s: f64,
    choke_pressure_ratio: f64,
    choke_flow_kg_s: f64,
    /// Corrected speed of turbo_a at equal tip speed, over 100 krpm.
    speed_ratio: f64,
}

impl ClosedFormMap {
    #[inline]
    fn ends(&self, speed_corrected_rpm: f64) -> SpeedLineEnds {
        let wheel_ratio = self.wheel_diameter_m / TURBO_A_WHEEL_M;
        let area_ratio = wheel_ratio * wheel_ratio;
        let n = wheel_ratio * speed_corrected_rpm / 100_000.0;
        let tip_speed_m_s = std::f64::consts::PI * self.wheel_diameter_m * speed_corrected_rpm / 60.0;
        let work = 1.0 + 1.06 * tip_speed_m_s * tip_speed_m_s / (2.0 * 1005.0 * ReferenceState::SAE.t_ref_k);
        // work^3.5 and n^1.25 by square roots: a third of the time of a general power.
        let zero_slope_pressure_ratio = work * work * work * work.sqrt();
        let n_125 = n * n.sqrt().sqrt();
        SpeedLineEnds {
            zero_slope_pressure_ratio,
            zero_slope_flow_kg_s: area_ratio * (0.0265 * power(n, 1.35)),
            choke_pressure_ratio: 1.0 + 0.15 * (zero_slope_pressure_ratio - 1.0),
            choke_flow_kg_s: area_ratio * (0.052 + 0.058 * n_125),
            speed_ratio: n,
        }
    }
}

impl CompressorCharacteristic for ClosedFormMap {
    fn reference(&self) -> ReferenceState {
        ReferenceState::SAE
    }

    #[inline]
    fn evaluate(&self, speed_corrected_rpm: f64, pressure_ratio: f64) -> CharacteristicPoint {
        self.evaluate_scaled(speed_corrected_rpm, pressure_ratio, 1.0)
    }

    #[inline]
    fn evaluate_scaled(
        &self,
        speed_corrected_rpm: f64,
        pressure_ratio: f64,
        flow_scale_ratio: f64,
    ) -> CharacteristicPoint {
        let ends = self.ends(speed_corrected_rpm);
        let (m_zs, m_ch) = (ends.zero_slope_flow_kg_s, ends.choke_flow_kg_s);
        let x = (pressure_ratio - ends.choke_pressure_ratio)
            / (ends.zero_slope_pressure_ratio - ends.choke_pressure_ratio);
        let unscaled = if x <= 0.0 {
            m_ch
        } else if x < 1.0 {
            m_zs + (m_ch - m_zs) * (1.0 - power(x, 2.2)).sqrt()
        } else {
            m_zs - 2.0 * m_zs * (x - 1.0)
        };
        let flow = flow_scale_ratio * unscaled;
        let n = ends.speed_ratio;
        let excess_speed = (n - 1.2).max(0.0);
        let peak = 0.74 - 0.07 * (n - 1.05) * (n - 1.05) - 0.10 * excess_speed * excess_speed;
        let best_flow = m_zs + 0.42 * (m_ch - m_zs);
        let offset = (flow - best_flow) / (m_ch - m_zs);
        CharacteristicPoint {
            flow_corrected_kg_s: flow,
            efficiency: (peak * (1.0 - 0.9 * offset * offset)).max(0.2),
            surge_position_ratio: x,
        }
    }

    fn surge_point(&self, speed_corrected_rpm: f64) -> (f64, f64) {
        let ends = self.ends(speed_corrected_rpm);
        (ends.zero_slope_flow_kg_s, ends.zero_slope_pressure_ratio)
    }

    fn choke_flow_corrected_kg_s(&self, speed_corrected_rpm: f64) -> f64 {
        self.ends(speed_corrected_rpm).choke_flow_kg_s
    }

    fn fingerprint(&self) -> String {
        format!("closed form turbo_a, wheel {} m", self.wheel_diameter_m)
    }
}

/// A map with the same flow and efficiency at any speed and pressure ratio.
#[derive(Debug, Clone, Copy)]
pub struct OnePointMap {
    /// Reference state of the corrected flow.
    pub reference: ReferenceState,
    /// Corrected flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Isentropic efficiency, fraction.
    pub efficiency: f64,
}

impl CompressorCharacteristic for OnePointMap {
    fn reference(&self) -> ReferenceState {
        self.reference
    }

    fn evaluate(&self, _: f64, _: f64) -> CharacteristicPoint {
        let OnePointMap { flow_corrected_kg_s, efficiency, .. } = *self;
        CharacteristicPoint { flow_corrected_kg_s, efficiency, surge_position_ratio: 0.5 }
    }

    fn evaluate_scaled(&self, speed_rpm: f64, pressure_ratio: f64, _: f64) -> CharacteristicPoint {
        self.evaluate(speed_rpm, pressure_ratio)
    }

    fn surge_point(&self, _: f64) -> (f64, f64) {
        (self.flow_corrected_kg_s, 1.0)
    }

    fn choke_flow_corrected_kg_s(&self, _: f64) -> f64 {
        self.flow_corrected_kg_s
    }

    fn fingerprint(&self) -> String {
        format!("{self:?}")
    }
}

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
    use proptest::prelude::*;

    proptest! {
        /// A compressor delivers less against more pressure, and more when it turns faster.
        #[test]
        fn flow_is_monotone(speed in 20e3..200e3f64, pr in 1.0..4.0f64, step in 1e-4..0.5f64) {
            let map = ClosedFormMap { wheel_diameter_m: 0.052 };
            let here = map.evaluate(speed, pr).flow_corrected_kg_s;
            prop_assert!(map.evaluate(speed, pr + step).flow_corrected_kg_s <= here);
            let inside = map.evaluate(speed, pr).surge_position_ratio < 1.0;
            prop_assert!(!inside || map.evaluate(speed * (1.0 + step), pr).flow_corrected_kg_s > here);
        }

        /// A similar compressor has the pressure ratio and efficiency of turbo_a at equal tip speed, and flow as the wheel's area.
        #[test]
        fn wheels_are_similar(speed in 20e3..200e3f64, pr in 1.0..4.0f64, ratio in 0.5..2.0f64) {
            let small = ClosedFormMap { wheel_diameter_m: TURBO_A_WHEEL_M };
            let large = ClosedFormMap { wheel_diameter_m: ratio * TURBO_A_WHEEL_M };
            let (a, b) = (small.evaluate(speed, pr), large.evaluate(speed / ratio, pr));
            prop_assert!((b.flow_corrected_kg_s / (ratio * ratio) - a.flow_corrected_kg_s).abs() < 1e-9);
            prop_assert!((a.efficiency - b.efficiency).abs() < 1e-9);
        }

        /// The line meets its own surge and choke ends.
        #[test]
        fn ends_lie_on_the_line(speed in 20e3..200e3f64) {
            let map = ClosedFormMap { wheel_diameter_m: 0.052 };
            let (flow, pr) = map.surge_point(speed);
            prop_assert!((map.evaluate(speed, pr).flow_corrected_kg_s - flow).abs() < 1e-6);
            prop_assert!((map.evaluate(speed, 1.0).flow_corrected_kg_s - map.choke_flow_corrected_kg_s(speed)).abs() < 1e-12);
        }
    }
}

#[cfg(test)]
mod characteristic_tests {
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
