//! Smooth deviations of an efficiency map: the allowed error of a measured map, in addition to its level.

use mapper_core::ReferenceState;
use mapper_core::unit_factors::RPM_PER_KRPM;
use mapper_physics::compressor_map::characteristic::{CharacteristicPoint, CompressorCharacteristic};
use std::sync::Arc;

/// Number of bumps over corrected speed. Bound: from 50 to 150 krpm, the speeds of a map.
const SPEEDS: usize = 6;
/// Centre of the first bump over corrected speed, 100 krpm. Bound: the lowest speed of a map.
const FIRST_SPEED: f64 = 0.5;
/// Width and spacing of the bumps over corrected speed, 100 krpm. Bound: the distance of the speed lines of a map.
const SPEED_WIDTH: f64 = 0.2;
/// Unit of the above, rpm. Source: a definition.
const SPEED_UNIT_RPM: f64 = 100.0 * RPM_PER_KRPM;
/// Distance from the first bump, in widths, beyond which all are negligible. Bound: e^-200, and no ratio may overflow.
const MAX_WIDTHS: f64 = 20.0;
/// Number of bumps between the surge line (0) and choke (1), each as wide as their distance. Bound: a speed line is measured at some five points.
const WAYS: usize = 3;

/// Number of basis functions.
pub(crate) const SHAPES: usize = SPEEDS * WAYS;

/// A map whose efficiency is multiplied by `1 + sum c_i phi_i(speed, place on the speed line)`.
#[derive(Debug, Clone)]
pub(crate) struct ShapedMap {
    /// The declared map.
    pub inner: Arc<dyn CompressorCharacteristic>,
    /// Coefficients of the basis, ratios.
    pub coefficients: [f64; SHAPES],
}

/// Gaussian bumps, a fifth of the speed range and a third of a speed line wide. A deviation may rise and fall from one operating point to
/// the next, and is smooth in between.
fn basis(speed_corrected_rpm: f64, surge_position_ratio: f64) -> [f64; SHAPES] {
    let speed = speed_corrected_rpm / SPEED_UNIT_RPM;
    let position = surge_position_ratio.clamp(0.0, 1.0);
    let way = (1.0 - position * position).sqrt();
    let over_speed: [f64; SPEEDS] = bumps((speed - FIRST_SPEED) / SPEED_WIDTH);
    let over_way: [f64; WAYS] = bumps(way * WAYS as f64 - 0.5);
    std::array::from_fn(|i| over_speed[i / WAYS] * over_way[i % WAYS])
}

/// `exp(-(x - i)^2 / 2)` for i = 0, 1, ... Each value follows from the one before by a ratio that falls by e, because exponentials dominate
/// the computing time of a diagnosis.
fn bumps<const N: usize>(widths_from_first: f64) -> [f64; N] {
    let x = widths_from_first.clamp(-MAX_WIDTHS, MAX_WIDTHS);
    let (mut bump, mut ratio) = ((-0.5 * x * x).exp(), (x - 0.5).exp());
    std::array::from_fn(|_| {
        let here = bump;
        bump *= ratio;
        ratio *= std::f64::consts::E.recip();
        here
    })
}

impl CompressorCharacteristic for ShapedMap {
    fn reference(&self) -> ReferenceState {
        self.inner.reference()
    }

    fn evaluate(&self, speed_corrected_rpm: f64, pressure_ratio: f64) -> CharacteristicPoint {
        self.evaluate_scaled(speed_corrected_rpm, pressure_ratio, 1.0)
    }

    fn evaluate_scaled(
        &self,
        speed_corrected_rpm: f64,
        pressure_ratio: f64,
        flow_scale_ratio: f64,
    ) -> CharacteristicPoint {
        let mut point = self.inner.evaluate_scaled(speed_corrected_rpm, pressure_ratio, flow_scale_ratio);
        let shapes = basis(speed_corrected_rpm, point.surge_position_ratio);
        let change: f64 = self.coefficients.iter().zip(shapes).map(|(c, phi)| c * phi).sum();
        point.efficiency *= 1.0 + change;
        point
    }

    fn surge_point(&self, speed_corrected_rpm: f64) -> (f64, f64) {
        self.inner.surge_point(speed_corrected_rpm)
    }

    fn choke_flow_corrected_kg_s(&self, speed_corrected_rpm: f64) -> f64 {
        self.inner.choke_flow_corrected_kg_s(speed_corrected_rpm)
    }

    fn fingerprint(&self) -> String {
        format!("{}, efficiency shaped by {:?}", self.inner.fingerprint(), self.coefficients)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bumps_are_gaussians_one_width_apart() {
        for x in [-3.0, -0.4, 0.0, 1.3, 5.0, 8.5] {
            for (i, bump) in bumps::<6>(x).into_iter().enumerate() {
                let expected = f64::exp(-0.5 * (x - i as f64).powi(2));
                // Tolerance: about ten roundings.
                assert!((bump - expected).abs() <= 1e-14 * expected, "{x} {i}: {bump:e} {expected:e}");
            }
        }
        assert!(bumps::<6>(1e9).into_iter().all(|bump| bump < 1e-40));
    }
}
