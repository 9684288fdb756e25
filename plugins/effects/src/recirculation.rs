//! Part of the gas recirculates through the wheel.

use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::TooManyExtraStates;
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// Part of the gas recirculates through the wheel.
    #[derive(Debug)]
    pub(crate) struct Recirculation {
        /// Recirculated share r of the delivered flow.
        recirculation_ratio = "recirculation" ["1"] 0.0 .. 0.3, neutral 0.0, step 0.03;
    }
}

impl EffectKind for Recirculation {
    const ABOUT: EffectText = EffectText {
        id: "recirculation",
        name: "recirculation",
        description: "part of the flow recirculates, hot, from the outlet of the wheel to its inlet",
        equation: "the wheel pumps (1 + r) m, the map's flow; T2' = T1' (1 + X)/(1 - r X), X = (PR^kappa - 1)/eta",
        source: "mixing balance of a ported shroud or backflow",
        submodel: Submodel::CompressorFlow,
        also_shows_in: &[Submodel::CompressorGas],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.model.params.compressor.recirculation_ratio += self.recirculation_ratio;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{CP1_J_KGK, Instant};

    /// The mixing balance itself: r m at T2' and m at T1' make the wheel's inlet; the wheel adds X to that.
    #[test]
    fn the_wheel_works_on_the_mixed_gas() {
        let r = 0.05;
        let (nominal, at) =
            (Instant::nominal().outputs, Instant::with(Recirculation { recirculation_ratio: r }).outputs);
        assert!((at.flow_kg_s * (1.0 + r) / nominal.flow_kg_s - 1.0).abs() < 1e-12);
        let mixed_k = (at.t1_prime_k + r * at.t2_prime_k) / (1.0 + r);
        let rise = nominal.t2_prime_k / nominal.t1_prime_k;
        assert!((at.t2_prime_k / (mixed_k * rise) - 1.0).abs() < 1e-12);
        let wheel_power_w = (1.0 + r) * at.flow_kg_s * CP1_J_KGK * (at.t2_prime_k - mixed_k);
        assert!((at.compressor_power_w / wheel_power_w - 1.0).abs() < 1e-12);
    }
}
