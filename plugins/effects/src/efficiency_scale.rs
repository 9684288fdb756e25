//! The compressor's efficiency is higher or lower.

use mapper_physics::effect;

effect! {
    pub(crate) struct EfficiencyScale "efficiency_scale";
    name: "compressor efficiency",
    description: "the compressor's efficiency is higher or lower everywhere",
    equation: "eta = s eta_nominal",
    source: "worn or fouled compressor",
    submodel: CompressorGas, also_shows_in: [Shaft];
    /// Efficiency over the map's.
    scale_ratio = "efficiency_scale" ["1"] 0.7 .. 1.3, neutral 1.0, step -0.02;
    |effect, rig| rig.model.params.compressor.efficiency_scale_ratio *= effect.scale_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Instant, T1_K};

    #[test]
    fn the_temperature_rise_grows_as_efficiency_falls() {
        let (nominal, worn) =
            (Instant::nominal().outputs, Instant::with(EfficiencyScale { scale_ratio: 0.97 }).outputs);
        let ratio = (worn.t2_prime_k - T1_K) / (nominal.t2_prime_k - T1_K);
        assert!((ratio - 1.0 / 0.97).abs() < 1e-12 && worn.flow_kg_s == nominal.flow_kg_s);
    }
}
