//! The convection of the compressor housing is stronger or weaker.

use mapper_physics::effect_parameters;
use mapper_physics::machine::hooks::TooManyExtraStates;
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::effect_kind::{EffectKind, EffectText};

effect_parameters! {
    /// The convection of the compressor housing is stronger or weaker.
    #[derive(Debug)]
    pub(crate) struct HtcScale {
        /// h over the correlation's.
        scale_ratio = "htc_scale" ["1"] 0.3 .. 3.0, neutral 1.0, step 0.2;
    }
}

impl EffectKind for HtcScale {
    const ABOUT: EffectText = EffectText {
        id: "htc_scale",
        name: "convection in the compressor",
        description: "convection between gas and compressor housing is stronger or weaker everywhere",
        equation: "h = s h_nominal",
        source: "Burke et al., eq. 9: its coefficient a",
        submodel: Submodel::CompressorGas,
        also_shows_in: &[Submodel::CompressorHousing],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.model.params.compressor.nusselt_coefficient *= self.scale_ratio;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    #[test]
    fn h_is_multiplied() {
        let ratio =
            Instant::with(HtcScale { scale_ratio: 1.2 }).outputs.h_w_m2k / Instant::nominal().outputs.h_w_m2k;
        assert!((ratio - 1.2).abs() < 1e-12);
    }
}
