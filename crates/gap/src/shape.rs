//! Smooth deviations of an efficiency map: what a measured map is allowed to be off by, beside its level.

use mapper_core::ReferenceState;
use mapper_physics::characteristic::{CharacteristicPoint, CompressorCharacteristic};
use std::sync::Arc;

/// Places of the bumps over corrected speed, 100 krpm.
const SPEEDS: [f64; 6] = [0.5, 0.7, 0.9, 1.1, 1.3, 1.5];
/// Places of the bumps over the way from the surge line (0) to choke (1).
const WAYS: [f64; 3] = [0.1, 0.4, 0.7];
/// Widths of a bump.
const SPEED_WIDTH: f64 = 0.2;
const WAY_WIDTH: f64 = 0.3;

/// Number of basis functions.
pub const SHAPES: usize = SPEEDS.len() * WAYS.len();

/// What the declared size is divided by for one coefficient. The root mean square of all together would be 1.7: a
/// deviation that lives in one corner of the map must not count as impossible.
pub const SHAPE_SUM: f64 = 1.0;

/// A map whose efficiency is multiplied by `1 + sum c_i phi_i(speed, place on the speed line)`.
#[derive(Debug, Clone)]
pub struct ShapedMap {
    /// The map as declared.
    pub inner: Arc<dyn CompressorCharacteristic>,
    /// Coefficients of the basis, ratios.
    pub coefficients: [f64; SHAPES],
}

/// Gaussian bumps a fifth of the speed range and a third of a speed line wide: a deviation may rise and fall from one
/// operating point to its neighbour, and is smooth between.
fn basis(speed_corrected_rpm: f64, surge_position_ratio: f64) -> [f64; SHAPES] {
    let speed = speed_corrected_rpm / 100_000.0;
    let position = surge_position_ratio.clamp(0.0, 1.0);
    let way = (1.0 - position * position).sqrt();
    // Beyond four widths a bump is below 4e-4: not worth an exponential.
    let bump = |away: f64, width: f64| {
        let widths = away / width;
        if widths.abs() > 4.0 { 0.0 } else { (-0.5 * widths * widths).exp() }
    };
    let over_speed = SPEEDS.map(|at| bump(speed - at, SPEED_WIDTH));
    let over_way = WAYS.map(|at| bump(way - at, WAY_WIDTH));
    std::array::from_fn(|i| over_speed[i / WAYS.len()] * over_way[i % WAYS.len()])
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
