//! Smooth deviations of an efficiency map: what a measured map is allowed to be off by, beside its level.

use mapper_core::ReferenceState;
use mapper_physics::characteristic::{CharacteristicPoint, CompressorCharacteristic};
use std::sync::Arc;

/// Number of basis functions.
pub const SHAPES: usize = 9;

/// A map whose efficiency is multiplied by `1 + sum c_i phi_i(speed, place on the speed line)`.
#[derive(Debug, Clone)]
pub struct ShapedMap {
    /// The map as declared.
    pub inner: Arc<dyn CompressorCharacteristic>,
    /// Coefficients of the basis, ratios.
    pub coefficients: [f64; SHAPES],
}

/// Legendre products without the constant, each of root mean square about 1: speed 0.4..1.6 times 100 krpm to the
/// third order, place on the line 0..1 to the second, mixed up to third.
fn basis(speed_corrected_rpm: f64, surge_position_ratio: f64) -> [f64; SHAPES] {
    let a = ((speed_corrected_rpm / 100_000.0 - 1.0) / 0.6).clamp(-1.3, 1.3);
    let b = (2.0 * surge_position_ratio - 1.0).clamp(-1.3, 1.3);
    let (p1, p2, p3) = (a, 1.5 * a * a - 0.5, 2.5 * a * a * a - 1.5 * a);
    let (q1, q2, q3) = (b, 1.5 * b * b - 0.5, 2.5 * b * b * b - 1.5 * b);
    let root = |n: f64| n.sqrt();
    [
        root(3.0) * p1,
        root(5.0) * p2,
        root(7.0) * p3,
        root(3.0) * q1,
        root(5.0) * q2,
        root(7.0) * q3,
        3.0 * p1 * q1,
        root(15.0) * p2 * q1,
        root(15.0) * p1 * q2,
    ]
}

impl CompressorCharacteristic for ShapedMap {
    fn reference(&self) -> ReferenceState {
        self.inner.reference()
    }

    fn evaluate(&self, speed_corrected_rpm: f64, pressure_ratio: f64) -> CharacteristicPoint {
        let mut point = self.inner.evaluate(speed_corrected_rpm, pressure_ratio);
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
