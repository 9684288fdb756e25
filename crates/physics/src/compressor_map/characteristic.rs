//! The interface between the model and a compressor map: flow and efficiency at a corrected speed and pressure ratio.
//!
//! The formulas are in [`closed_form_map`](crate::compressor_map::closed_form_map) and
//! [`tabulated_map`](crate::compressor_map::tabulated_map), with their known answers.

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
