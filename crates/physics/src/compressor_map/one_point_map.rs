//! The map of a machine at one measured point.

use crate::compressor_map::characteristic::{CharacteristicPoint, CompressorCharacteristic};
use mapper_core::ReferenceState;

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
