//! The compressor's efficiency is higher or lower.

use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::TooManyExtraStates;
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// The compressor's efficiency is higher or lower.
    #[derive(Debug)]
    pub(crate) struct EfficiencyScale {
        /// Efficiency over the map's.
        scale_ratio = "efficiency_scale" ["1"] 0.7 .. 1.3, neutral 1.0, step -0.02;
    }
}

impl EffectKind for EfficiencyScale {
    const ABOUT: EffectText = EffectText {
        id: "efficiency_scale",
        name: "compressor efficiency",
        description: "the compressor's efficiency is higher or lower everywhere",
        equation: "eta = s eta_nominal",
        source: "worn or fouled compressor",
        submodel: Submodel::CompressorGas,
        also_shows_in: &[Submodel::Shaft],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.model.params.compressor.efficiency_scale_ratio *= self.scale_ratio;
        Ok(())
    }
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
