//! The compressor delivers more or less flow.

use mapper_physics::effect;

effect! {
    pub(crate) struct FlowMapScale "flow_map_scale";
    name: "compressor flow",
    description: "the compressor delivers more or less flow at equal speed and pressure ratio",
    equation: "m_corr = s m(N, PR), eta(N, m_corr): the efficiency is that of the map at the delivered flow",
    source: "worn or fouled compressor, other trim",
    submodel: CompressorFlow, also_shows_in: [];
    /// Corrected flow over the map's.
    scale_ratio = "flow_map_scale" ["1"] 0.7 .. 1.3, neutral 1.0, step 0.03;
    |effect, rig| rig.model.params.compressor.flow_scale_ratio *= effect.scale_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;
    use mapper_core::ReferenceState;
    use mapper_physics::compressor_map::closed_form_map::ClosedFormMap;
    use mapper_physics::compressor_map::closed_form_map::{CharacteristicPoint, CompressorCharacteristic};

    /// At 110 krpm the flow of best efficiency is below the flow of the point: more flow is less efficient, by the closed form's own
    /// parabola. A map with only speed lines gives the same to first order.
    #[test]
    fn flow_is_multiplied_and_the_efficiency_is_that_of_the_flow() {
        let (nominal, other) =
            (Instant::nominal().outputs, Instant::with(FlowMapScale { scale_ratio: 1.03 }).outputs);
        assert!((other.flow_kg_s / nominal.flow_kg_s - 1.03).abs() < 1e-12);
        let map = ClosedFormMap { wheel_diameter_m: 0.052 };
        for (speed_rpm, pressure_ratio) in [(60e3, 1.15), (110e3, 1.6), (140e3, 2.4)] {
            let here = map.evaluate(speed_rpm, pressure_ratio);
            let scaled = map.evaluate_scaled(speed_rpm, pressure_ratio, 1.01);
            // The point on the same speed line with that flow.
            let at = |pr: f64| map.evaluate(speed_rpm, pr).flow_corrected_kg_s - scaled.flow_corrected_kg_s;
            let (mut low, mut high) = (1.0, pressure_ratio);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if at(middle) > 0.0 { low = middle } else { high = middle }
            }
            let along = map.evaluate(speed_rpm, low).efficiency;
            assert!((scaled.efficiency - along).abs() < 1e-9, "{speed_rpm}");
            let first_order = OnlyLines(map).evaluate_scaled(speed_rpm, pressure_ratio, 1.01).efficiency;
            // Second order in one per cent of the flow.
            assert!((first_order - along).abs() < 0.1 * (along - here.efficiency).abs() + 1e-4);
        }
    }

    /// A map with only speed lines.
    #[derive(Debug)]
    struct OnlyLines(ClosedFormMap);

    impl CompressorCharacteristic for OnlyLines {
        fn reference(&self) -> ReferenceState {
            self.0.reference()
        }
        fn evaluate(&self, speed_corrected_rpm: f64, pressure_ratio: f64) -> CharacteristicPoint {
            self.0.evaluate(speed_corrected_rpm, pressure_ratio)
        }
        fn surge_point(&self, speed_corrected_rpm: f64) -> (f64, f64) {
            self.0.surge_point(speed_corrected_rpm)
        }
        fn choke_flow_corrected_kg_s(&self, speed_corrected_rpm: f64) -> f64 {
            self.0.choke_flow_corrected_kg_s(speed_corrected_rpm)
        }
        fn fingerprint(&self) -> String {
            self.0.fingerprint()
        }
    }
}
