//! The virtual laboratory's own compressor, "turbo_a", in closed form.
//!
//! The paper does not print its map tables; these formulas replace them. A speed line is part of an ellipse-like curve between a
//! zero-slope and a choke point, and the efficiency is a parabola over flow. They were fitted by eye to the ranges plotted in the paper, 50
//! to 170 krpm corrected to SAE's reference state, and continue smoothly outside these ranges.
//! Compressors with another wheel are geometrically similar: equal tip speed gives equal pressure ratio and efficiency, and a flow in
//! proportion to the square of the wheel (e.g. Dixon and Hall, Fluid Mechanics and Thermodynamics of Turbomachinery, ch. 2).

use crate::compressor_map::characteristic::{CharacteristicPoint, CompressorCharacteristic};
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

/// The two ends of a speed line.
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
